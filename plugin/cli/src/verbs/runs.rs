//! `playbot runs ls|show|compare`.
//!
//! The folder, in reading order:
//!
//! - `show`: `playbot runs show`.
//! - `compare`: `playbot runs compare`.

mod compare;
mod show;

use crate::{
    error::{CliError, Outcome},
    output::{print_line, print_table, program},
};
use playbot_harness::{games::Games, sealed_file::write_atomically};
use playbot_report::{PlainTable, percent, readable, whole};
use playbot_train::{
    metrics_log::{EPISODIC_RETURN, SUCCESS_RATE},
    runs::{FoundRuns, Leftover, RunRecord, RunsError},
};
use serde_json::{Value, json};
use std::{
    path::{Path, PathBuf},
    time::SystemTime,
};

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
    Ls(LsArgs),
    /// Show the settings and the metrics of a run.
    Show(show::Args),
    /// Compare runs. Those that differ only in their seed are one group.
    Compare(compare::Args),
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    match args.verb.unwrap_or_else(|| Verb::Ls(LsArgs::default())) {
        Verb::Ls(args) => run_ls(&args),
        Verb::Show(args) => show::run(&args, games),
        Verb::Compare(args) => compare::run(&args),
    }
}

/// Writes a plot, whole or not at all, and prints its path.
fn write_plot(path: &Path, svg: &str) -> Result<(), CliError> {
    write_atomically(path, svg.as_bytes())?;
    report!("plot: {}", path.display());
    Ok(())
}

// `playbot runs ls`.

/// The default folder of runs.
const RUNS: &str = "runs";

/// Placeholder for a missing number.
pub(crate) const UNKNOWN: &str = "–";

/// List the runs in a folder and the folders below it, and the remains of replaced runs. Exit code 1 if a run is
/// damaged.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot runs ls
  playbot runs ls runs/study --json")]
pub struct LsArgs {
    /// The folder.
    #[arg(default_value = RUNS)]
    root: PathBuf,
    /// One line of JSON per run, and per remains of a run.
    #[arg(long)]
    json: bool,
}

impl Default for LsArgs {
    fn default() -> Self {
        Self { root: RUNS.into(), json: false }
    }
}

pub(crate) fn run_ls(args: &LsArgs) -> Result<Outcome, CliError> {
    let (mut table, mut damaged) = (table(), Vec::new());
    let found = FoundRuns::at(&args.root)?;
    for path in found.runs {
        match RunRecord::read(&path) {
            Ok(run) if args.json => print_line(to_json(&run))?,
            Ok(run) => table.rows.push(row(&run)),
            Err(error) if args.json => {
                print_line(json!({ "path": path, "error": error.to_string() }))?;
                damaged.push(error);
            }
            Err(error) => damaged.push(error),
        }
    }
    if !args.json {
        print_runs(&table, &damaged)?;
    }
    found.leftovers.iter().try_for_each(|leftover| print_leftover(leftover, args.json))?;
    Ok(if damaged.is_empty() { Outcome::Pass } else { Outcome::Findings })
}

fn print_runs(table: &PlainTable, damaged: &[RunsError]) -> Result<(), CliError> {
    if !table.rows.is_empty() {
        print_table(table)?;
    }
    for error in damaged {
        print_line(format!("damaged: {error}"))?;
    }
    Ok(())
}

/// Prints a folder that is no run, with advice.
fn print_leftover(leftover: &Leftover, as_json: bool) -> Result<(), CliError> {
    let words = program::named(&leftover.to_string());
    if as_json {
        print_line(json!({ "path": leftover.folder, "left_of": leftover.run, "advice": words }))
    } else {
        print_line(format!("left over: {words}"))
    }
}

fn table() -> PlainTable {
    let columns =
        ["run", "game", "algorithm", "seed", "steps", "of", "return", "success", "steps/s", "updated", "state"];
    PlainTable { columns: columns.map(str::to_owned).to_vec(), ..PlainTable::default() }
}

fn row(run: &RunRecord) -> Vec<String> {
    let known = |value: Option<f64>, words: fn(f64) -> String| value.map_or(UNKNOWN.to_owned(), words);
    let state = match (run.is_finished(), run.checkpoints.is_empty()) {
        _ if !run.info.algorithm.has_checkpoints() => "nothing to train",
        (false, _) if run.is_training => "training",
        (true, false) => "finished",
        (true, true) => "finished, no checkpoint",
        (false, false) => "can be resumed",
        (false, true) => "no checkpoint yet",
    };
    vec![
        run.path.display().to_string(),
        run.experiment.game.clone(),
        run.info.algorithm.name().to_owned(),
        run.info.seed.to_string(),
        whole(run.steps() as f64),
        whole(run.experiment.whole_steps() as f64),
        known(run.curves.last(EPISODIC_RETURN), readable),
        known(run.curves.last(SUCCESS_RATE), percent),
        run.curves.steps_per_s().map_or(UNKNOWN.to_owned(), whole),
        age_s(run).map_or(UNKNOWN.to_owned(), |seconds| format!("{} ago", duration(seconds))),
        state.to_owned(),
    ]
}

/// Returns the JSON of a run for `ls` and `show`.
pub(crate) fn to_json(run: &RunRecord) -> Value {
    json!({
        "path": run.path,
        "game": run.experiment.game,
        "algorithm": run.info.algorithm.name(),
        "seed": run.info.seed,
        "steps": run.steps(),
        "steps_logged": run.curves.last_step(),
        "steps_planned": run.experiment.steps,
        "finished": run.is_finished(),
        "training": run.is_training,
        "episodic_return": run.curves.last(EPISODIC_RETURN),
        "success_rate": run.curves.last(SUCCESS_RATE),
        "steps_per_s": run.curves.steps_per_s(),
        "age_s": age_s(run),
        "checkpoints": run.checkpoints.iter().map(|checkpoint| checkpoint.summary).collect::<Vec<_>>(),
        "game_version": run.info.game_version,
        "version": run.info.version,
        "revision": run.info.revision,
        "skills": run.info.skills,
        "begun_from": run.info.begun_from,
        "device": run.info.device,
    })
}

/// Returns the seconds since the run was last logged to.
pub(crate) fn age_s(run: &RunRecord) -> Option<u64> {
    Some(SystemTime::now().duration_since(run.updated?).unwrap_or_default().as_secs())
}

/// Formats seconds in the largest unit that fits.
pub(crate) fn duration(seconds: u64) -> String {
    match seconds {
        0..120 => format!("{seconds} s"),
        120..7200 => format!("{} min", seconds / 60),
        7200..172_800 => format!("{} h", seconds / 3600),
        _ => format!("{} days", seconds / 86_400),
    }
}
