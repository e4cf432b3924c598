//! Metrics of training, logged after each update.
//!
//! - `metrics.jsonl`: one line per update, the same bytes for the same seed. A value that is not a number is `null`.
//! - `timing.jsonl`: values that differ between runs: seconds, steps per second, time of day.
//! - `tensorboard/`: both again, as an event file. It is derived: a resumed run writes it anew.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    time::{SystemTime, UNIX_EPOCH},
};

use playbot_learner::disk::DiskFile;
use serde_json::{Value, json};

pub use super::update_report::{CLIPPED_SHARE, EPISODES, EPISODIC_LENGTH, EPISODIC_RETURN, SUCCESS_RATE};
use super::{
    json_lines::{JsonLines, append_json_line},
    log_gaps::gaps,
    run_error::{RunError, io_error},
    tensorboard::{Event, EventFolder, EventKind},
    update_report::UpdateReport,
};
use crate::sealed_file::write_atomically;

/// Tag of the environment steps per second.
pub const SPS: &str = "charts/SPS";
/// Tags of the means over the last 100 episodes.
pub const EPISODE_MEANS: [&str; 3] = [EPISODIC_RETURN, EPISODIC_LENGTH, SUCCESS_RATE];

/// Returns the natural range of a metric; `None` if any value is possible.
pub fn range_of(tag: &str) -> Option<(f64, f64)> {
    [SUCCESS_RATE, CLIPPED_SHARE].contains(&tag).then_some((0.0, 1.0))
}

/// The files of a run that hold its metrics.
#[derive(Clone, Debug)]
pub struct MetricsLog {
    metrics: PathBuf,
    timing: PathBuf,
    events: PathBuf,
}

impl MetricsLog {
    /// Makes the log of the run in `folder`.
    pub fn new(folder: &Path) -> Self {
        let file = |name| folder.join(name);
        Self { metrics: file("metrics.jsonl"), timing: file("timing.jsonl"), events: file("tensorboard") }
    }

    /// Returns the path of `metrics.jsonl`.
    pub fn metrics_file(&self) -> &Path {
        &self.metrics
    }

    /// Returns the path of `timing.jsonl`.
    pub fn timing_file(&self) -> &Path {
        &self.timing
    }

    /// Appends an update to all files, and returns once the operating system has it.
    ///
    /// # Errors
    ///
    /// [`RunError::Io`].
    pub fn append(&self, report: &UpdateReport, steps_per_update: u64) -> Result<(), RunError> {
        self.write(report.step, &metrics_line(report), &timing_line(report, steps_per_update, wall_time()))
    }

    /// Waits until everything appended is on the disk, for a checkpoint that relies on it.
    ///
    /// # Errors
    ///
    /// [`RunError::Io`].
    pub(super) fn sync(&self) -> Result<(), RunError> {
        let there = [&self.metrics, &self.timing].into_iter().filter(|path| path.exists());
        there
            .into_iter()
            .try_for_each(|path| DiskFile::append(path).and_then(|file| file.sync()).map_err(io_error("write", path)))
    }

    fn write(&self, step: u64, metrics: &Value, timing: &Value) -> Result<(), RunError> {
        append_json_line(&self.metrics, metrics).map_err(io_error("write", &self.metrics))?;
        append_json_line(&self.timing, timing).map_err(io_error("write", &self.timing))?;
        let folder = EventFolder::new(self.events.clone());
        folder.append(&event(step, metrics, Some(timing))).map_err(io_error("write", &self.events))
    }

    /// Drops log lines after `step`, and torn lines. Warns of damaged or missing lines among the `updates` before.
    ///
    /// # Errors
    ///
    /// [`RunError::Io`]; each file is then either unchanged or complete.
    pub fn rewind(&self, step: u64, updates: u64) -> Result<(), RunError> {
        let metrics = keep_until(&self.metrics, step, updates)?;
        let timing: BTreeMap<u64, Value> = keep_until(&self.timing, step, updates)?.into_iter().collect();
        let events: Vec<Event> = metrics.iter().map(|(step, line)| event(*step, line, timing.get(step))).collect();
        let folder = EventFolder::new(self.events.clone());
        folder.rewrite(&events, wall_time()).map_err(io_error("write", &self.events))
    }
}

/// Returns seconds since 1970. This is the only read of the clock here, and computed values do not depend on it.
fn wall_time() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

/// Returns one update under the tags known to TensorBoard users.
fn metrics_line(report: &UpdateReport) -> Value {
    let mut line = json!({ "step": report.step, "update": report.update });
    for (tag, value) in report.scalars() {
        line[tag] = json!(value);
    }
    line
}

fn timing_line(report: &UpdateReport, steps_per_update: u64, wall_time: f64) -> Value {
    let timing = report.timing;
    json!({
        "step": report.step, "collect_s": timing.collect_s, "learn_s": timing.learn_s, "wall_time": wall_time,
        SPS: steps_per_update as f64 / (timing.collect_s + timing.learn_s),
    })
}

/// Returns the tags of a line with their values; `null` is NaN. Names without `/` are not metrics.
pub fn scalars(line: &Value) -> impl Iterator<Item = (&str, f64)> {
    let entries = line.as_object().into_iter().flatten().filter(|(tag, _)| tag.contains('/'));
    entries.map(|(tag, value)| (tag.as_str(), value.as_f64().unwrap_or(f64::NAN)))
}

/// Returns the event of an update, from its lines.
fn event(step: u64, metrics: &Value, timing: Option<&Value>) -> Event {
    let values = scalars(metrics).chain(timing.into_iter().flat_map(scalars));
    let kind = EventKind::Scalars(values.map(|(tag, value)| (tag.to_owned(), value)).collect());
    Event { wall_time: timing.and_then(|line| line["wall_time"].as_f64()).unwrap_or(0.0), step, kind }
}

/// Cuts a file after `step`, and returns the rest. Warns of missing lines.
fn keep_until(path: &Path, step: u64, updates: u64) -> Result<Vec<(u64, Value)>, RunError> {
    let mut read = JsonLines::read(path).map_err(io_error("read", path))?;
    read.lines.retain(|line| line.step <= step);
    if let Some(words) = gaps(&read, step, updates) {
        tracing::warn!("{}: {words}", path.display());
    }
    let lines = read.lines;
    let text: String = lines.iter().flat_map(|line| [&line.text, "\n"]).collect();
    write_atomically(path, text.as_bytes())?;
    Ok(lines.into_iter().map(|line| (line.step, line.value)).collect())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::{super::tensorboard::testing::events_after_the_header, *};

    /// Writes updates with a value that is not a number and one that needs all its digits.
    fn write(log: &MetricsLog, steps: [u64; 2]) {
        for step in steps {
            let metrics = json!({ "step": step, "update": 1, "losses/a": f64::NAN, "charts/b": 0.1 * step as f64 });
            let timing = json!({ "step": step, "collect_s": 1.0, "wall_time": 1000.5 + step as f64, SPS: 64.0 });
            log.write(step, &metrics, &timing).expect("writable");
        }
    }

    fn content(log: &MetricsLog) -> [Vec<u8>; 3] {
        let read = |file| fs::read(file).expect("written");
        [read(&log.metrics), read(&log.timing), events_after_the_header(&log.events)]
    }

    #[test]
    fn a_log_that_was_rewound_is_as_if_nothing_had_followed() {
        let folder = tempfile::tempdir().expect("a folder");
        let log = MetricsLog::new(folder.path());
        write(&log, [8, 16]);
        let before = content(&log);
        write(&log, [24, 32]);
        let all = content(&log);
        // Killed within a write of each file.
        for (file, whole) in [&log.metrics, &log.timing].into_iter().zip(&all) {
            fs::write(file, &whole[..whole.len() - 9]).expect("writable");
        }
        log.rewind(16, 2).expect("writable");
        assert!(content(&log) == before);
        write(&log, [24, 32]);
        assert!(content(&log) == all);
    }

    #[test]
    fn event_files_are_made_anew_from_the_lines() {
        let folder = tempfile::tempdir().expect("a folder");
        let log = MetricsLog::new(folder.path());
        log.rewind(0, 0).expect("nothing is there yet");
        write(&log, [8, 16]);
        let before = content(&log);
        fs::remove_dir_all(&log.events).expect("deleted");
        log.rewind(16, 2).expect("writable");
        assert!(content(&log) == before);
        let lines = JsonLines::read(&log.metrics).expect("readable").lines;
        let (tags, values): (Vec<_>, Vec<_>) = scalars(&lines[0].value).unzip();
        assert_eq!(tags, ["charts/b", "losses/a"]);
        assert!(values[0] == 0.8 && values[1].is_nan());
    }
}
