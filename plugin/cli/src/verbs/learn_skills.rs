//! `playbot learn-skills`.

use crate::{
    arguments::{
        Compute, at_least_one_step, check_start,
        experiment::{ExperimentArgs, Options, in_words, option, quoted},
    },
    error::{CliError, Outcome},
    output::{prepare, print_line, program},
    progress::{console::Console, interrupt},
};
use playbot_harness::games::Games;
use playbot_learner::{SkillMetrics, SkillModel};
use playbot_train::{
    learn_skills::{LearnSkillsError, checkpoint_of, learn_into, remove_checkpoint},
    recordings::read_dataset,
};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Learn the skill model (encoder, decoder, prior) from recordings.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot learn-skills GAME --out skills.safetensors
  playbot learn-skills --set observation=Raster --max-steps 30000 --out pixels.safetensors
  playbot learn-skills --experiment my.ron --demos recordings/ --epochs 30 --out skills.safetensors
  playbot learn-skills --out skills.safetensors --resume")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// File or folder of recordings, instead of the experiment's.
    #[arg(long)]
    demos: Option<PathBuf>,
    /// Learn from at most this many recorded steps, instead of the experiment's `demo_steps`. Whole episodes are taken,
    /// and at least one, however long it is.
    #[arg(long, value_parser = at_least_one_step)]
    max_steps: Option<u64>,
    /// Passes over the recordings, instead of the experiment's.
    #[arg(long)]
    epochs: Option<usize>,
    /// File to write.
    #[arg(long)]
    out: PathBuf,
    /// Start anew: overwrite the file, and delete the checkpoint that Ctrl-C or a crash left, if any.
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// Resume work that Ctrl-C or a crash stopped, from FILE.checkpoint.
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    pub(crate) compute: Compute,
    /// Print the metrics of each epoch as a line of JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let experiment =
        args.from.load(games, [option("skills.epochs", &args.epochs), option("demo_steps", &args.max_steps)])?;
    let Some(checkpoint) = checkpoint(&args)? else { return finished(&args) };
    let game = args.from.find_game(games, &experiment)?;
    let demos = match &args.demos {
        Some(demos) => demos.clone(),
        None => args.from.recordings(&experiment, games)?,
    };
    experiment.check_skill_memory(game).map_err(|error| args.from.locate(games, [], error))?;
    check_start(game, &experiment.train.mode, experiment.train.first)?;
    prepare(&args.out)?;
    let go_on = format!("the same command and {}", if args.force { "--resume instead of --force" } else { "--resume" });
    note_unlearned(Some(checkpoint.as_path()).filter(|checkpoint| !args.force && checkpoint.exists()), &go_on);
    let mut console = Console::new("").going_on_with(&go_on);
    if args.json {
        console = console.on_epoch(|epoch, metrics| print_line(epoch_json(epoch, metrics)));
    }
    let dataset = read_dataset(game, &experiment, &demos, args.compute.threads(), &mut console)?;
    if args.force {
        // Not earlier: an old checkpoint stays if there is nothing to learn from.
        remove_checkpoint(&checkpoint)?;
    }
    let own = own_options(&args);
    let options = Options { from: &args.from, own: &own };
    let learned = learn_into(&args.out, &experiment.with_sets(game), dataset, args.compute.device(), &mut console);
    let learned = learned.map_err(|error| explain(error, &options))?;
    console.result()?;
    if learned.is_none() {
        report!("stopped and saved; no skill model is written yet: go on with {go_on}");
        return Ok(Outcome::Stopped);
    }
    report!("skill model written to {}", args.out.display());
    Ok(Outcome::Pass)
}

/// Explains an error of learning. Other settings than those of a checkpoint are named with the options that set them.
pub(crate) fn explain(error: LearnSkillsError, options: &Options<'_>) -> CliError {
    match error {
        LearnSkillsError::OtherSettings { path, wanted, begun } => CliError::Usage(format!(
            "{} was begun with other settings: {}; ask for the same, or start anew with --force",
            path.display(),
            in_words(options.differences(&wanted, &begun, "the training", &[]))
        )),
        other => other.into(),
    }
}

/// Notes the saved state before this process has learned anything, for a stop while recordings are replayed. It is the
/// checkpoint to resume from, if there is one.
fn note_unlearned(checkpoint: Option<&Path>, go_on: &str) {
    let (left, command) = match checkpoint {
        Some(checkpoint) => (format!("{} is kept as it was", checkpoint.display()), go_on),
        None => ("nothing is learned yet".to_owned(), "the same command"),
    };
    interrupt::leave(left);
    interrupt::go_on_with(command.to_owned());
}

/// Returns the checkpoint's path, if it may be resumed or created; `None` if the model is finished.
fn checkpoint(args: &Args) -> Result<Option<PathBuf>, CliError> {
    let checkpoint = checkpoint_of(&args.out);
    // The advice about a folder comes with the attempt to write there.
    let is_there = args.out.exists() && !args.out.is_dir();
    match (args.resume, is_there, checkpoint.exists()) {
        _ if args.force => Ok(Some(checkpoint)),
        // A run with --force was stopped, and the old model is still there.
        (true, _, true) | (false, false, false) => Ok(Some(checkpoint)),
        (true, true, false) => Ok(None),
        (true, false, false) => Err(CliError::Usage(format!(
            "nothing to resume: there is no {}; leave --resume out to begin",
            checkpoint.display()
        ))),
        (false, _, true) => Err(CliError::Usage(format!(
            "{} holds an unfinished training: go on with --resume, or start anew with --force",
            checkpoint.display()
        ))),
        (false, true, false) => Err(CliError::Usage(format!(
            "{} exists already: overwrite it with --force, or name another file with --out",
            args.out.display()
        ))),
    }
}

/// Reports that nothing is left to resume. A file that is no skill model is not called one.
fn finished(args: &Args) -> Result<Outcome, CliError> {
    SkillModel::load(&args.out, args.compute.device())?;
    let (out, program) = (quoted(&args.out.display().to_string()), program::name());
    report!(
        "{out} is finished: train with it, `{program} train --skills {out} --run runs/first`, or learn it anew with --force"
    );
    Ok(Outcome::Pass)
}

/// Returns the options that have names of their own, by the keys that they set.
fn own_options(args: &Args) -> [(&'static str, Option<String>); 2] {
    [
        ("skills.epochs", args.epochs.map(|epochs| format!("--epochs {epochs}"))),
        ("demo_steps", args.max_steps.map(|steps| format!("--max-steps {steps}"))),
    ]
}

/// Returns the metrics of an epoch as JSON; null for a metric that was not measured.
pub(crate) fn epoch_json(epoch: u64, metrics: &SkillMetrics) -> serde_json::Value {
    json!({
        "epoch": epoch, "loss": metrics.loss, "nll": metrics.nll, "kl": metrics.kl, "accuracy": metrics.accuracy,
        "held_out_nll": metrics.held_out_nll(), "held_out_kl": metrics.held_out.map(|held_out| held_out.kl),
        "state_error": metrics.state_error, "held_out_state_error": metrics.held_out.and_then(|held_out| held_out.state_error),
    })
}
