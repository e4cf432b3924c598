//! The files of a study: its tables and curves, and the cost of its runs, which differs from machine to machine.

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use playbot_learner::HasExitCode;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::study::StudyRun;
use crate::{
    report::{StudyReport, markdown_table, to_svg},
    sealed_file::{SealedFileError, read_sealed, write_atomically, write_sealed},
};

/// The file of results.
pub const RESULTS: &str = "results.json";

const TABLE: &str = "table.md";

/// The file of the cost in the folder of a run.
const COST: &str = "cost.json";

/// Failure to write the files of a study.
#[derive(Debug, Error)]
pub enum StudyOutputError {
    /// The experiment cannot be written as text.
    #[error("cannot write the experiment: {0}")]
    Experiment(String),
    /// The results of an earlier study cannot be written as a table.
    #[error("{file}: {message}")]
    Results {
        /// Their file.
        file: String,
        /// The problem.
        message: String,
    },
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] SealedFileError),
}

impl HasExitCode for StudyOutputError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Experiment(_) | Self::Results { .. } => 3,
            Self::File(error) => error.exit_code(),
        }
    }
}

/// Writes `table.md`, `curves.svg` and `results.json`.
///
/// # Errors
///
/// A file cannot be written.
pub fn write_report(folder: &Path, report: &StudyReport) -> Result<(), StudyOutputError> {
    let table = report.to_markdown().map_err(|error| StudyOutputError::Experiment(error.to_string()))?;
    let json = report.to_json().map_err(|error| StudyOutputError::Experiment(error.to_string()))?;
    write_atomically(&folder.join(TABLE), table.as_bytes())?;
    write_atomically(&folder.join("curves.svg"), to_svg(&report.charts()).as_bytes())?;
    Ok(write_atomically(&folder.join(RESULTS), json.as_bytes())?)
}

/// Writes `table.md` again from `results.json`. Learning curves are not in there, so `curves.svg` stays as it is.
///
/// # Errors
///
/// There are no results, or they are damaged.
pub fn rewrite_table(folder: &Path) -> Result<(), StudyOutputError> {
    let path = folder.join(RESULTS);
    let refused = |message: String| StudyOutputError::Results { file: path.display().to_string(), message };
    if !path.exists() {
        let message = "there is no such file: run the study, or name the folder of one that is done";
        return Err(refused(message.to_owned()));
    }
    let (report, _) = read_sealed::<StudyReport>(&path)?;
    let table = report.to_markdown().map_err(|error| refused(error.to_string()))?;
    Ok(write_atomically(&folder.join(TABLE), table.as_bytes())?)
}

/// Writes `cost.md`: the cost of each variant, over its seeds, and the command.
///
/// # Errors
///
/// It cannot be written.
pub fn write_cost(
    folder: &Path,
    runs: &[StudyRun],
    runs_folder: &Path,
    command: &str,
    threads: usize,
) -> Result<(), SealedFileError> {
    write_atomically(&folder.join("cost.md"), cost_table(runs, runs_folder, command, threads).as_bytes())
}

/// Time that was spent on a run, over all resumptions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Cost {
    /// Seconds of all processors together; `None` where the system does not report it.
    cpu_s: Option<f64>,
    /// Seconds by the clock.
    wall_s: f64,
}

/// A clock that runs while a run is worked on.
pub(super) struct CostClock {
    begun: Instant,
    cpu: Option<Duration>,
}

impl CostClock {
    pub(super) fn start() -> Self {
        Self { begun: Instant::now(), cpu: cpu_time() }
    }

    /// Adds the elapsed time to the cost of the run in `folder`.
    ///
    /// # Errors
    ///
    /// It cannot be written.
    pub(super) fn note(&self, folder: &Path) -> Result<(), SealedFileError> {
        let spent = self.cpu.zip(cpu_time()).map(|(before, now)| now.saturating_sub(before).as_secs_f64());
        let before = Cost::of(folder);
        let cost = Cost {
            cpu_s: match before {
                Some(before) => before.cpu_s.zip(spent).map(|(before, spent)| before + spent),
                None => spent,
            },
            wall_s: before.unwrap_or_default().wall_s + self.begun.elapsed().as_secs_f64(),
        };
        write_sealed(&folder.join(COST), &cost)
    }
}

impl Cost {
    /// Reads the cost of the run in `folder` so far; `None` if there is no note, or the note is damaged.
    fn of(folder: &Path) -> Option<Self> {
        let file = folder.join(COST);
        if !file.exists() {
            return None;
        }
        read_sealed(&file)
            .inspect_err(|error| tracing::warn!("{error}; the earlier cost of the run is unknown"))
            .map_or(None, |(cost, _)| Some(cost))
    }
}

/// Formats a table of the cost of each variant, over its seeds, and the command.
fn cost_table(runs: &[StudyRun], folder: &Path, command: &str, threads: usize) -> String {
    let mut rows = Vec::new();
    let mut total = (0.0, 0.0, true);
    let mut variants: Vec<&str> = runs.iter().map(|run| run.variant.as_str()).collect();
    variants.dedup();
    for variant in variants {
        let of_variant: Vec<&StudyRun> = runs.iter().filter(|run| run.variant == variant).collect();
        let costs: Vec<Option<Cost>> = of_variant.iter().map(|run| Cost::of(&folder.join(run.id()))).collect();
        let sum = |of: fn(&Cost) -> Option<f64>| -> Option<f64> {
            costs.iter().map(|cost| cost.as_ref().and_then(of)).sum::<Option<f64>>()
        };
        let (cpu, wall) = (sum(|cost| cost.cpu_s), sum(|cost| Some(cost.wall_s)));
        let trained = of_variant.iter().filter(|run| run.experiment.algorithm.is_trained());
        let steps: u64 = trained.map(|run| run.experiment.whole_steps()).sum();
        total = (total.0 + cpu.unwrap_or(0.0), total.1 + wall.unwrap_or(0.0), total.2 && cpu.is_some());
        rows.push(vec![variant.to_owned(), of_variant.len().to_string(), steps.to_string(), hours(cpu), hours(wall)]);
    }
    let cpu = if total.2 { hours(Some(total.0)) } else { format!("at least {}", hours(Some(total.0))) };
    format!(
        "# What the study has cost\n\n```sh\n{command} --threads {threads}\n```\n\n{}\n{cpu} CPU hours in all, {} by the clock, with \
         {}. A skill model is learned within the first run that needs it.\n",
        markdown_table(&["variant", "runs", "environment steps", "CPU hours", "hours"], rows.into_iter()),
        hours(Some(total.1)),
        if threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") },
    )
}

fn hours(seconds: Option<f64>) -> String {
    seconds.map_or("–".to_owned(), |seconds| format!("{:.3}", seconds / 3600.0))
}

/// Returns the time that all processors have spent on this process, where Linux reports it.
fn cpu_time() -> Option<Duration> {
    // The name in brackets may hold anything.
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    let mut fields = stat.rsplit_once(')')?.1.split_ascii_whitespace().skip(11);
    let ticks: u64 = fields.next()?.parse::<u64>().ok()? + fields.next()?.parse::<u64>().ok()?;
    // The kernel counts these in hundredths of a second for every program, whatever its own clock does.
    Some(Duration::from_millis(ticks * 10))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_gone_on_with_costs_more() {
        let folder = tempfile::tempdir().expect("a folder");
        let clock = CostClock::start();
        let mut sum = 0u64;
        while clock.begun.elapsed() < Duration::from_millis(60) {
            sum = sum.wrapping_add(1);
        }
        assert!(sum > 0);
        clock.note(folder.path()).expect("writable");
        let once = Cost::of(folder.path()).expect("noted");
        clock.note(folder.path()).expect("writable");
        let twice = Cost::of(folder.path()).expect("noted");
        assert!(once.wall_s >= 0.06 && twice.wall_s >= 2.0 * once.wall_s, "{once:?}, {twice:?}");
        if cfg!(target_os = "linux") {
            assert!(twice.cpu_s.expect("Linux says it") >= 2.0 * once.cpu_s.expect("Linux says it"));
        }
    }
}
