//! What the runs of a study have cost, kept apart from its tables: those are the same on every machine.

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use playbot_lab::{
    report::markdown_table,
    train::{
        sealed_file::{read_sealed, write_sealed},
        study::StudyRun,
    },
};
use serde::{Deserialize, Serialize};

use super::{error::CliError, number::counted};

/// The file in the folder of a run.
const COST: &str = "cost.json";

/// Time that was spent on a run, over all the times that it was gone on with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Seconds of all processors together; `None` where the system does not say.
    cpu_s: Option<f64>,
    /// Seconds by the clock.
    wall_s: f64,
}

/// A clock that runs while a run is worked on.
pub struct CostClock {
    begun: Instant,
    cpu: Option<Duration>,
}

impl CostClock {
    pub fn start() -> Self {
        Self { begun: Instant::now(), cpu: cpu_time() }
    }

    /// Adds the time since then to what the run in `folder` has cost.
    ///
    /// # Errors
    ///
    /// It cannot be written.
    pub fn note(&self, folder: &Path) -> Result<(), CliError> {
        let spent = self.cpu.zip(cpu_time()).map(|(before, now)| now.saturating_sub(before).as_secs_f64());
        let before = Cost::of(folder);
        let cost = Cost {
            cpu_s: match before {
                Some(before) => before.cpu_s.zip(spent).map(|(before, spent)| before + spent),
                None => spent,
            },
            wall_s: before.unwrap_or_default().wall_s + self.begun.elapsed().as_secs_f64(),
        };
        Ok(write_sealed(&folder.join(COST), &cost)?)
    }
}

impl Cost {
    /// What the run in `folder` has cost so far; `None` if nobody has noted it, or the note is damaged.
    fn of(folder: &Path) -> Option<Self> {
        let file = folder.join(COST);
        if !file.exists() {
            return None;
        }
        read_sealed(&file)
            .inspect_err(|error| tracing::warn!("{error}; what the run has cost before is not known"))
            .map_or(None, |(cost, _)| Some(cost))
    }
}

/// A table of what each variant has cost, over its seeds, and the command.
pub fn cost_table(runs: &[StudyRun], folder: &Path, command: &str, threads: usize) -> String {
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
        counted(threads as u64, "thread"),
    )
}

fn hours(seconds: Option<f64>) -> String {
    seconds.map_or("–".to_owned(), |seconds| format!("{:.3}", seconds / 3600.0))
}

/// Time that all processors have spent on this process, where Linux says so.
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
