//! `playbot runs ls|show|compare`.

mod compare;
mod ls;
mod show;

use std::path::Path;

use playbot_lab::{games::Games, sealed_file::write_atomically};

use super::error::{CliError, Outcome};

/// List, show and compare runs.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot runs ls
  playbot runs show runs/first --plot first.svg
  playbot runs compare runs/study --threshold 0.8 --plot compare.svg
  playbot runs compare runs/ppo-1 runs/ppo-2 runs/score-1 runs/score-2 --metric charts/episodic_return
  tensorboard --logdir runs                        the same curves in TensorBoard (pip install tensorboard)")]
pub struct Args {
    /// Verb to run; `ls` if left out.
    #[command(subcommand)]
    verb: Option<Verb>,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// List runs and their progress.
    Ls(ls::Args),
    /// Show the settings and the metrics of a run.
    Show(show::Args),
    /// Compare runs. Those that differ only in their seed are one group.
    Compare(compare::Args),
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    match args.verb.unwrap_or_else(|| Verb::Ls(ls::Args::default())) {
        Verb::Ls(args) => ls::run(&args),
        Verb::Show(args) => show::run(&args, games),
        Verb::Compare(args) => compare::run(&args),
    }
}

/// Writes a plot, whole or not at all, and prints its path.
fn write_plot(path: &Path, svg: &str) -> Result<(), CliError> {
    write_atomically(path, svg.as_bytes())?;
    tell!("plot: {}", path.display());
    Ok(())
}
