//! `playbot learn-skills`.

use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use playbot_lab::games::Games;
use playbot_lab::train::Experiment;
use playbot_learner::{Dataset, DeviceKind, FileError, SkillMetrics, SkillModel, SkillTrainer, disk};
use serde_json::json;

use super::{
    compute::Compute,
    differences::{Options, in_words},
    error::{CliError, Outcome, print_line},
    experiment::{ExperimentArgs, option, quoted},
    interrupt,
    number::counted,
    open,
    output::{beside, prepare},
    program, progress,
    read_demos::read_demos,
};

/// Learn the skill model (encoder, decoder, prior) from recordings.
#[derive(clap::Args)]
#[command(mut_arg("threads", |threads| threads.help("Threads that replay recordings; the result does not depend on it")))]
#[command(after_help = "Examples:
  playbot learn-skills GAME --out skills.safetensors
  playbot learn-skills --set observation=Raster --max-steps 30000 --out eyes.safetensors
  playbot learn-skills --experiment my.ron --demos recordings/ --epochs 30 --out skills.safetensors
  playbot learn-skills --out skills.safetensors --resume")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// File or folder of recordings, instead of the experiment's.
    #[arg(long)]
    demos: Option<PathBuf>,
    /// Learn from at most so many recorded steps, instead of the experiment's `demo_steps`. Whole episodes are taken, and
    /// at least one, however long it is.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    max_steps: Option<u64>,
    /// Passes over the recordings, instead of the experiment's.
    #[arg(long)]
    epochs: Option<usize>,
    /// File to write.
    #[arg(long)]
    out: PathBuf,
    /// Start anew: overwrite the file, and forget what Ctrl-C or a crash stopped, if there is any.
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// Go on where Ctrl-C or a crash stopped, from FILE.checkpoint.
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    compute: Compute,
    /// Print the metrics of each epoch as a line of JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let experiment =
        args.from.load(games, [option("skills.epochs", &args.epochs), option("demo_steps", &args.max_steps)])?;
    let Some(checkpoint) = checkpoint(&args)? else { return finished(&args) };
    let game = open::game(games, &args.from, &experiment)?;
    let demos = match &args.demos {
        Some(demos) => demos.clone(),
        None => args.from.recordings(&experiment, games)?,
    };
    experiment.check_skill_memory(game).map_err(|error| args.from.locate(games, [], error))?;
    prepare(&args.out)?;
    let go_on = format!("the same command and {}", if args.force { "--resume instead of --force" } else { "--resume" });
    note_unlearned(Some(checkpoint.as_path()).filter(|checkpoint| !args.force && checkpoint.exists()), &go_on);
    let dataset = read_demos(game, &experiment, &demos, args.compute.threads())?;
    if args.force {
        // Not earlier: what there is stays if there is nothing to learn from.
        remove(&checkpoint)?;
    }
    let report = |epoch, metrics: &SkillMetrics| {
        if args.json { print_line(epoch_json(epoch, metrics)) } else { Ok(()) }
    };
    let own = own_options(&args);
    let options = Options { from: &args.from, own: &own };
    let unfinished = SkillCheckpoint { path: &checkpoint, options, go_on: Some(&go_on) };
    match learn(&experiment, dataset, args.compute.device(), Some(&unfinished), report)? {
        None => {
            tell!("stopped and saved; no skill model is written yet: go on with {go_on}");
            return Ok(Outcome::Stopped);
        }
        Some(model) => {
            model.save(&args.out)?;
            remove(&checkpoint)?;
            tell!("skill model written to {}", args.out.display());
        }
    }
    Ok(Outcome::Pass)
}

/// Notes what there is before this process has learned anything, for whoever stops it while recordings are replayed: the
/// checkpoint that it goes on with, if there is one.
fn note_unlearned(checkpoint: Option<&Path>, go_on: &str) {
    let (left, command) = match checkpoint {
        Some(checkpoint) => (format!("{} is kept as it was", checkpoint.display()), go_on),
        None => ("nothing is learned yet".to_owned(), "the same command"),
    };
    interrupt::leave(left);
    interrupt::go_on_with(command.to_owned());
}

/// Where the state of an unfinished training is kept.
pub fn checkpoint_of(out: &Path) -> PathBuf {
    beside(out, ".checkpoint")
}

/// Removes a checkpoint that is not needed any more, if there is one.
///
/// # Errors
///
/// The system refuses.
pub fn remove(checkpoint: &Path) -> Result<(), CliError> {
    match disk::remove_file(checkpoint) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(CliError::Io(format!("cannot remove {}: {error}", checkpoint.display())))
        }
        _ => Ok(()),
    }
}

/// The checkpoint's path, if what lies there fits what was asked for; `None` if there is nothing left to go on with.
fn checkpoint(args: &Args) -> Result<Option<PathBuf>, CliError> {
    let checkpoint = checkpoint_of(&args.out);
    // What to do about a folder is said where it is tried to write there.
    let is_there = args.out.exists() && !args.out.is_dir();
    match (args.resume, is_there, checkpoint.exists()) {
        _ if args.force => Ok(Some(checkpoint)),
        // Somebody began anew with --force, and the old model is still there.
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

/// Says that there is nothing to go on with. A file that is no skill model is not called one.
fn finished(args: &Args) -> Result<Outcome, CliError> {
    SkillModel::load(&args.out, args.compute.device())?;
    let (out, program) = (quoted(&args.out.display().to_string()), program::name());
    tell!(
        "{out} is finished: train with it, `{program} train --skills {out} --run runs/first`, or learn it anew with --force"
    );
    Ok(Outcome::Pass)
}

/// The options that have names of their own, by the keys that they set.
fn own_options(args: &Args) -> [(&'static str, Option<String>); 2] {
    [
        ("skills.epochs", args.epochs.map(|epochs| format!("--epochs {epochs}"))),
        ("demo_steps", args.max_steps.map(|steps| format!("--max-steps {steps}"))),
    ]
}

/// The state of a training that may have been begun already.
pub struct SkillCheckpoint<'a> {
    /// Its file.
    pub path: &'a Path,
    /// What the command line asks for, to say what differs.
    pub options: Options<'a>,
    /// What goes on with it, once it is there, if that is another command than before.
    pub go_on: Option<&'a str>,
}

/// The metrics of an epoch; null for what was not measured.
pub fn epoch_json(epoch: u64, metrics: &SkillMetrics) -> serde_json::Value {
    json!({
        "epoch": epoch, "loss": metrics.loss, "nll": metrics.nll, "kl": metrics.kl, "accuracy": metrics.accuracy,
        "held_out_nll": metrics.held_out_nll(), "held_out_kl": metrics.held_out.map(|held_out| held_out.kl),
        "state_error": metrics.state_error, "held_out_state_error": metrics.held_out.and_then(|held_out| held_out.state_error),
    })
}

/// Learns the model, with a progress bar and, where there is room for one, a checkpoint after each epoch, from which a
/// stopped training goes on bit for bit. `None` after Ctrl-C.
///
/// # Errors
///
/// A loss is not a number, the checkpoint belongs to another training, or it or `after_epoch` fails.
pub fn learn(
    experiment: &Experiment,
    dataset: Dataset,
    device: DeviceKind,
    checkpoint: Option<&SkillCheckpoint>,
    mut after_epoch: impl FnMut(u64, &SkillMetrics) -> Result<(), CliError>,
) -> Result<Option<SkillModel>, CliError> {
    let epochs = experiment.skills.epochs as u64;
    let mut trainer = begin(experiment, dataset, device, checkpoint)?;
    let mut last = None;
    let per_epoch = trainer.batches_per_epoch() as u64;
    let bar = progress::bar("learn skills", epochs * per_epoch, "batches");
    bar.set_position(trainer.epochs_done() * per_epoch + trainer.batches_done() as u64);
    while trainer.epochs_done() < epochs && !trainer.is_over() {
        let metrics = trainer.train_epoch(&mut |_| {
            bar.inc(1);
            if interrupt::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        if let Some(SkillCheckpoint { path, go_on, .. }) = checkpoint {
            trainer.save(path)?;
            if let Some(command) = go_on {
                interrupt::go_on_with((*command).to_owned());
            }
            let epochs = counted(trainer.epochs_done(), "whole epoch");
            interrupt::leave(format!("{} is kept, after {epochs}", path.display()));
        }
        let Some(metrics) = metrics else {
            bar.finish_and_clear();
            return Ok(None);
        };
        last = metrics.held_out_nll();
        let apart = last.map_or(String::new(), |nll| format!(", held-out NLL {nll:.3}"));
        bar.set_message(format!("NLL {:.3} KL {:.2}{apart}", metrics.nll, metrics.kl));
        after_epoch(trainer.epochs_done(), &metrics)?;
    }
    bar.finish_and_clear();
    tell_held_out(&trainer, last);
    Ok(Some(trainer.into_model().with_picture(experiment.observation_config().card())))
}

/// Says how the model that is kept does on the episodes that it has not learned from, if there are any: that of the best epoch,
/// or else of the last one, after which that was `last`.
fn tell_held_out(trainer: &SkillTrainer, last: Option<f32>) {
    let done = trainer.epochs_done();
    match (trainer.best_epoch().zip(trainer.best_nll()), last) {
        (Some((best, nll)), _) => {
            tell!("held-out NLL {nll:.2} after epoch {best}, the best of {done}, whose model is kept");
        }
        (None, Some(nll)) => tell!("held-out NLL {nll:.2} after epoch {done}, the last, whose model is kept"),
        (None, None) => {}
    }
}

/// A trainer at its start, or where the checkpoint left it.
fn begin(
    experiment: &Experiment,
    dataset: Dataset,
    device: DeviceKind,
    checkpoint: Option<&SkillCheckpoint>,
) -> Result<SkillTrainer, CliError> {
    let Some(SkillCheckpoint { path, options, .. }) = checkpoint.filter(|checkpoint| checkpoint.path.exists()) else {
        return Ok(SkillTrainer::new(experiment.skills.clone(), dataset, experiment.seed, device)?);
    };
    let trainer = SkillTrainer::load(path, dataset, device).map_err(unusable)?;
    let begun = Experiment { skills: trainer.config().clone(), seed: trainer.seed(), ..experiment.clone() };
    if begun != *experiment {
        return Err(CliError::Usage(format!(
            "{} was begun with other settings: {}; ask for the same, or start anew with --force",
            path.display(),
            in_words(options.differences(experiment, &begun, "the training", &[]))
        )));
    }
    tell!("going on in epoch {} of {}", trainer.epochs_done() + 1, experiment.skills.epochs);
    Ok(trainer)
}

/// What to do about a checkpoint that cannot be gone on with: other recordings are no help against damage.
fn unusable(error: FileError) -> CliError {
    let next = match error {
        FileError::Io { .. } => return error.into(),
        FileError::CutOff { .. } | FileError::Damaged { .. } | FileError::Foreign { .. } => {
            "nothing can go on from it: learn anew with --force"
        }
        FileError::Newer { .. } => "or start anew with --force",
        _ => "go on with the recordings that it began with, or start anew with --force",
    };
    CliError::Usage(format!("{error}; {next}"))
}
