//! `playbot learn-skills`.

use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use bevy_playbot::{
    demo::dataset::load_dataset,
    game::Game,
    learner::{Dataset, DeviceKind, SkillMetrics, SkillModel, SkillTrainer},
    train::Experiment,
};
use serde_json::json;

use super::{
    error::{CliError, Outcome, print_line},
    experiment::{self, ExperimentArgs, option},
    interrupt, progress,
};
use crate::registry;

/// Learns the skill model (encoder, decoder, prior) from recordings.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot learn-skills --out skills.safetensors
  playbot learn-skills --experiment my.ron --demos recordings/ --epochs 30 --out skills.safetensors")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// File or folder of recordings, instead of the experiment's.
    #[arg(long)]
    demos: Option<PathBuf>,
    /// Passes over the recordings, instead of the experiment's.
    #[arg(long)]
    epochs: Option<usize>,
    /// File to write.
    #[arg(long)]
    out: PathBuf,
    /// Overwrite the file if it exists.
    #[arg(long)]
    force: bool,
    /// Where to compute: flex or ndarray.
    #[arg(long, default_value_t)]
    device: DeviceKind,
    /// Print the metrics of each epoch as a line of JSON.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<Outcome, CliError> {
    let experiment = args.from.load([option("skills.epochs", &args.epochs)])?;
    if args.out.exists() && !args.force {
        return Err(CliError::Usage(format!("{} exists already; overwrite it with --force", args.out.display())));
    }
    let game = registry::game(&experiment.game)?;
    let demos = args.demos.clone().unwrap_or_else(|| experiment::resolve(&experiment.demos));
    let dataset = read_demos(game, &demos)?;
    interrupt::listen();
    let json = args.json;
    let model =
        learn(
            &experiment,
            dataset,
            args.device,
            |epoch, metrics| {
                if json { print_line(epoch_json(epoch, metrics)) } else { Ok(()) }
            },
        )?;
    model.save(&args.out)?;
    eprintln!("skill model written to {}", args.out.display());
    Ok(Outcome::Pass)
}

fn epoch_json(epoch: u64, metrics: &SkillMetrics) -> serde_json::Value {
    json!({
        "epoch": epoch, "loss": metrics.loss, "nll": metrics.nll, "kl": metrics.kl, "accuracy": metrics.accuracy,
    })
}

/// Reads recordings, replaying them through the game's sensor where they keep no observations.
///
/// # Errors
///
/// A recording cannot be read or belongs to another game.
pub fn read_demos(game: &dyn Game, path: &Path) -> Result<Dataset, CliError> {
    let bar = progress::bar("replay recordings", 0, "steps");
    let dataset = load_dataset(game, path, |steps| {
        bar.set_length(steps);
        bar.set_position(steps);
    });
    bar.finish_and_clear();
    let dataset = dataset?;
    eprintln!("{} steps in {} episodes from {}", dataset.steps(), dataset.episodes(), path.display());
    Ok(dataset)
}

/// Learns the model, with a progress bar; stops early after Ctrl-C, with what has been learned so far.
///
/// # Errors
///
/// A loss is not a number, or `after_epoch` fails.
pub fn learn(
    experiment: &Experiment,
    dataset: Dataset,
    device: DeviceKind,
    mut after_epoch: impl FnMut(u64, &SkillMetrics) -> Result<(), CliError>,
) -> Result<SkillModel, CliError> {
    let epochs = experiment.skills.epochs as u64;
    let mut trainer = SkillTrainer::new(experiment.skills.clone(), dataset, experiment.seed, device)?;
    let bar = progress::bar("learn skills", epochs * trainer.batches_per_epoch() as u64, "batches");
    for epoch in 1..=epochs {
        let metrics = trainer.train_epoch(&mut |_| {
            bar.inc(1);
            if interrupt::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        let Some(metrics) = metrics else { break };
        bar.set_message(format!("NLL {:.3} KL {:.2}", metrics.nll, metrics.kl));
        after_epoch(epoch, &metrics)?;
    }
    bar.finish_and_clear();
    Ok(trainer.into_model())
}
