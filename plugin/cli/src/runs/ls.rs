//! `playbot runs ls`.

use std::{path::PathBuf, time::SystemTime};

use playbot_lab::{
    report::{PlainTable, percent, readable, whole},
    runs::{FoundRuns, Leftover, RunRecord, RunsError},
    train::metrics_log::{EPISODIC_RETURN, SUCCESS_RATE},
};
use serde_json::{Value, json};

use super::super::{
    error::{CliError, Outcome, print_line},
    program,
};

/// The default folder of runs.
const RUNS: &str = "runs";

/// Placeholder for a missing number.
pub const UNKNOWN: &str = "–";

/// List the runs in a folder and the folders below it, and the remains of replaced runs. Exit code 1 if a run is
/// damaged.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot runs ls
  playbot runs ls runs/study --json")]
pub struct Args {
    /// The folder.
    #[arg(default_value = RUNS)]
    root: PathBuf,
    /// One line of JSON per run, and per remains of a run.
    #[arg(long)]
    json: bool,
}

impl Default for Args {
    fn default() -> Self {
        Self { root: RUNS.into(), json: false }
    }
}

pub fn run(args: &Args) -> Result<Outcome, CliError> {
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
        print_table(&table, &damaged)?;
    }
    found.leftovers.iter().try_for_each(|leftover| print_leftover(leftover, args.json))?;
    Ok(if damaged.is_empty() { Outcome::Pass } else { Outcome::Findings })
}

fn print_table(table: &PlainTable, damaged: &[RunsError]) -> Result<(), CliError> {
    if !table.rows.is_empty() {
        print_line(table.to_text().trim_end())?;
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
        _ if !run.info.algorithm.is_trained() => "nothing to train",
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
pub fn to_json(run: &RunRecord) -> Value {
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
        "device": run.info.device,
    })
}

/// Returns the seconds since the run was last logged to.
pub fn age_s(run: &RunRecord) -> Option<u64> {
    Some(SystemTime::now().duration_since(run.updated?).unwrap_or_default().as_secs())
}

/// Formats seconds in the largest unit that fits.
pub fn duration(seconds: u64) -> String {
    match seconds {
        0..120 => format!("{seconds} s"),
        120..7200 => format!("{} min", seconds / 60),
        7200..172_800 => format!("{} h", seconds / 3600),
        _ => format!("{} days", seconds / 86_400),
    }
}
