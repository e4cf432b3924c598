//! Metrics of training, logged after each update: [`UpdateReport`] with the tags of its values, and [`MetricsLog`] with
//! their files.
//!
//! - `metrics.jsonl`: one line per update, the same bytes for the same seed. A value that is not a number is `null`.
//! - `timing.jsonl`: values that differ between runs: seconds, steps per second, time of day.
//! - `tensorboard/`: both again, as an event file. It is derived: a resumed run writes it anew.

use crate::tensorboard::{Event, EventFolder, EventKind};
use playbot_harness::sealed_file::{SealedFileError, io_error, unsealed_line, write_atomically};
use playbot_learner::{LearnerMetrics, disk::DiskFile, seal_json};
use serde::Serialize;
use serde_json::{Value, json};
use std::{
    collections::{BTreeMap, BTreeSet},
    fs, io,
    io::Write,
    path::{Path, PathBuf},
    time::{SystemTime, UNIX_EPOCH},
};

/// Tag of the environment steps per second.
pub const SPS: &str = "charts/SPS";

/// Tag of the success rate of the last 100 episodes.
pub const SUCCESS_RATE: &str = "charts/success_rate";

/// Tag of the mean return of the last 100 episodes.
pub const EPISODIC_RETURN: &str = "charts/episodic_return";

/// Tag of the mean length of the last 100 episodes, ticks.
pub const EPISODIC_LENGTH: &str = "charts/episodic_length";

/// Tag of the share of clipped actions in the last 100 episodes.
pub const CLIPPED_SHARE: &str = "charts/clipped_share";

/// Tag of the number of episodes that have ended.
pub const EPISODES: &str = "charts/episodes";

/// Tag of the number of the current lesson, from 1 on.
pub const LESSON: &str = "levels/lesson";

/// Tag of the success rate of the last episodes of the current lesson.
pub const LESSON_SUCCESS: &str = "levels/lesson_success";

/// Tags of the means over the last 100 episodes.
pub const EPISODE_MEANS: [&str; 3] = [EPISODIC_RETURN, EPISODIC_LENGTH, SUCCESS_RATE];

/// Episodes over which the current return, length and success rate are averaged.
pub(crate) const RECENT: usize = 100;

/// Results of one update. Everything except `timing` is the same in every run with the same seed.
#[derive(Clone, Debug)]
pub struct UpdateReport {
    /// Updates done, this one included.
    pub update: u64,
    /// Environment steps done, over all arenas together.
    pub step: u64,
    /// Episodes that have ended. Before the 100th, the means below are over fewer episodes, of which short ones end
    /// first.
    pub episodes: u64,
    /// Mean return of the last 100 episodes; `None` before the first has ended.
    pub episodic_return: Option<f64>,
    /// Mean length of the last 100 episodes, ticks.
    pub episodic_length: Option<f64>,
    /// Success rate of the last 100 episodes.
    pub success_rate: Option<f64>,
    /// Share of the ticks of the last 100 episodes whose action was clipped to the game's range; only for continuous
    /// actions.
    pub clipped_share: Option<f64>,
    /// KL divergence from decoder to policy before the first update; only in the first report of SCORE.
    pub initial_kl: Option<f32>,
    /// The current lesson, and the scores of its levels, by their tags; empty without a curriculum and an order of levels.
    pub levels: Vec<(&'static str, f64)>,
    /// The learner's metrics.
    pub learner: LearnerMetrics,
    /// Time spent.
    pub timing: Timing,
}

/// Returns whether so many episodes have ended that means over the last 100 are of 100. Before, short episodes weigh more.
pub fn is_settled(episodes: u64) -> bool {
    episodes >= RECENT as u64
}

impl UpdateReport {
    /// Returns whether at least 100 episodes have ended.
    pub fn is_settled(&self) -> bool {
        is_settled(self.episodes)
    }

    /// Returns whether at least 100 episodes have ended, and at least this share of the last 100 succeeded.
    pub fn mostly_succeeds(&self, share: f64) -> bool {
        self.is_settled() && self.success_rate.is_some_and(|rate| rate >= share)
    }

    /// Returns all measurements by TensorBoard tag; the same numbers in every run with the same seed.
    pub fn scalars(&self) -> Vec<(&'static str, f64)> {
        let episodes = [
            (EPISODES, Some(self.episodes as f64)),
            (EPISODIC_RETURN, self.episodic_return),
            (EPISODIC_LENGTH, self.episodic_length),
            (SUCCESS_RATE, self.success_rate),
            (CLIPPED_SHARE, self.clipped_share),
            ("score/initial_kl", self.initial_kl.map(f64::from)),
        ];
        let known = episodes.into_iter().filter_map(|(tag, value)| Some((tag, value?)));
        known.chain(self.levels.iter().copied()).chain(self.learner.scalars()).collect()
    }
}

/// Wall-clock seconds of one update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Timing {
    /// Simulating, observing and deciding, and joining the parts of all Worlds.
    pub collect_s: f64,
    /// Learning, and all else.
    pub learn_s: f64,
    /// The part of `collect_s` after the Worlds have played, in which their parts are joined.
    pub join_s: f64,
    /// The part of `learn_s` in which minibatches are assembled.
    pub gather_s: f64,
    /// The part of `learn_s` with the products and sums of networks and losses, forward and backward.
    pub products_s: f64,
    /// The part of `learn_s` with the steps of the optimiser.
    pub optimise_s: f64,
    /// Seconds of all of it in which one thread worked, at most: the others had no World left to play and no loop to
    /// share.
    pub alone_s: f64,
}

impl Timing {
    /// Returns the seconds of the whole update.
    pub fn whole_s(&self) -> f64 {
        self.collect_s + self.learn_s
    }

    /// Returns its parts by their tags, which add up to the whole, and the share of it in which one thread worked.
    pub fn scalars(&self) -> [(&'static str, f64); 7] {
        let Self { collect_s, learn_s, join_s, gather_s, products_s, optimise_s, alone_s } = *self;
        [
            ("time/play_s", collect_s - join_s),
            ("time/join_s", join_s),
            ("time/gather_s", gather_s),
            ("time/products_s", products_s),
            ("time/optimise_s", optimise_s),
            ("time/rest_s", learn_s - gather_s - products_s - optimise_s),
            ("time/alone_share", alone_s / self.whole_s()),
        ]
    }
}

/// Returns the natural range of a metric; `None` if any value is possible.
pub fn range_of(tag: &str) -> Option<(f64, f64)> {
    [SUCCESS_RATE, CLIPPED_SHARE, LESSON_SUCCESS].contains(&tag).then_some((0.0, 1.0))
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
    /// [`SealedFileError::Io`].
    pub fn append(&self, report: &UpdateReport, steps_per_update: u64) -> Result<(), SealedFileError> {
        self.write(report.step, &metrics_line(report), &timing_line(report, steps_per_update, wall_time()))
    }

    /// Waits until everything appended is on the disk, for a checkpoint that relies on it.
    ///
    /// # Errors
    ///
    /// [`SealedFileError::Io`].
    pub(crate) fn sync(&self) -> Result<(), SealedFileError> {
        let there = [&self.metrics, &self.timing].into_iter().filter(|path| path.exists());
        there
            .into_iter()
            .try_for_each(|path| DiskFile::append(path).and_then(|file| file.sync()).map_err(io_error("write", path)))
    }

    fn write(&self, step: u64, metrics: &Value, timing: &Value) -> Result<(), SealedFileError> {
        append_json_line(&self.metrics, metrics).map_err(io_error("write", &self.metrics))?;
        append_json_line(&self.timing, timing).map_err(io_error("write", &self.timing))?;
        let folder = EventFolder::new(self.events.clone());
        folder.append(&event(step, metrics, Some(timing))).map_err(io_error("write", &self.events))
    }

    /// Drops log lines after `step`, and torn lines. Warns of damaged or missing lines among the `updates` before.
    ///
    /// # Errors
    ///
    /// [`SealedFileError::Io`]; each file is then either unchanged or complete.
    pub fn rewind(&self, step: u64, updates: u64) -> Result<(), SealedFileError> {
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
    let mut line = json!({
        "step": report.step, "collect_s": timing.collect_s, "learn_s": timing.learn_s, "wall_time": wall_time,
        SPS: steps_per_update as f64 / timing.whole_s(),
    });
    for (tag, value) in timing.scalars() {
        line[tag] = json!(value);
    }
    line
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
fn keep_until(path: &Path, step: u64, updates: u64) -> Result<Vec<(u64, Value)>, SealedFileError> {
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

// Warnings about damaged or missing log lines, for resumed runs.

/// Largest number of gaps that are named; beyond it their number is given.
const NAMED: usize = 8;

/// Describes the damaged lines, which are left out, and the missing updates up to `step`. A log that is missing or
/// was cut off between two lines would look whole otherwise. `None` without gaps.
///
/// `read` has no lines after `step`, up to which `updates` updates were made. A line after it that a kill tore is
/// written again, and is not mentioned.
pub(crate) fn gaps(read: &JsonLines, step: u64, updates: u64) -> Option<String> {
    let parts: Vec<String> = [damaged(read, step), missing(read, step, updates)].into_iter().flatten().collect();
    (!parts.is_empty()).then(|| parts.join("; "))
}

fn damaged(read: &JsonLines, step: u64) -> Option<String> {
    let is_whole_until = read.lines.last().map_or(0, |line| line.step) == step;
    let harmless = usize::from(read.is_torn && is_whole_until);
    let damaged = &read.damaged[..read.damaged.len().saturating_sub(harmless)];
    let numbers: Vec<String> = damaged.iter().map(usize::to_string).collect();
    match numbers.len() {
        0 => None,
        1 => Some(format!("line {} is damaged and left out", numbers[0])),
        _ => Some(format!("lines {} are damaged and left out", numbers.join(", "))),
    }
}

fn missing(read: &JsonLines, step: u64, updates: u64) -> Option<String> {
    let found: BTreeSet<u64> = read.lines.iter().map(|line| line.step).collect();
    // Every update has the same number of steps.
    let words = match step.checked_div(updates) {
        Some(per_update) if per_update * updates == step => {
            let is_missing = |update: &u64| !found.contains(&(update * per_update));
            of_updates((1..=updates).filter(is_missing).collect(), per_update)?
        }
        _ => {
            let missing = updates.saturating_sub(found.len() as u64);
            if missing == 0 {
                return None;
            }
            format!("{missing} of {updates} updates")
        }
    };
    Some(format!("metrics are missing for {words}: curves have a gap there, and learning is not affected"))
}

/// Describes updates by their steps; `None` without updates.
fn of_updates(updates: Vec<u64>, per_update: u64) -> Option<String> {
    let stretches: Vec<(u64, u64)> = updates
        .chunk_by(|one, next| one + 1 == *next)
        .filter_map(|stretch| Some((stretch.first()? * per_update, stretch.last()? * per_update)))
        .collect();
    let name = |(first, last): &(u64, u64)| {
        if first == last { first.to_string() } else { format!("{first} to {last}") }
    };
    let named: Vec<String> = stretches.iter().take(NAMED).map(name).collect();
    let more = if stretches.len() > NAMED { " and others" } else { "" };
    match updates.len() {
        0 => None,
        1 => Some(format!("the update of step {}", named.join(""))),
        count => Some(format!("{count} updates, those of the steps {}{more}", named.join(", "))),
    }
}

// Files with one line of JSON per update, whose end a crash can tear.

/// One line.
#[derive(Clone, Debug, PartialEq)]
pub struct JsonLine {
    /// Its text as written, with its checksum if any, and without the line feed.
    pub text: String,
    /// Its `step`.
    pub step: u64,
    /// Its JSON value.
    pub value: Value,
    /// True if it has a checksum, which older versions did not write.
    pub had_seal: bool,
}

/// Content of a file of JSON lines.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JsonLines {
    /// The whole lines, in their order.
    pub lines: Vec<JsonLine>,
    /// Numbers, from 1, of lines that are not JSON, lack a step, or have a wrong checksum.
    pub damaged: Vec<usize>,
    /// True if the last line has no end, as after a crash.
    pub is_torn: bool,
}

impl JsonLines {
    /// Reads a file; a missing one is empty.
    ///
    /// # Errors
    ///
    /// The operating system refuses.
    pub fn read(path: &Path) -> io::Result<Self> {
        let bytes = match fs::read(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            other => other?,
        };
        let mut found = Self { is_torn: bytes.last().is_some_and(|byte| *byte != b'\n'), ..Self::default() };
        for (index, line) in bytes.split(|byte| *byte == b'\n').enumerate().filter(|(_, line)| !line.is_empty()) {
            match parse(line) {
                Some(line) => found.lines.push(line),
                None => found.damaged.push(index + 1),
            }
        }
        Ok(found)
    }
}

fn parse(line: &[u8]) -> Option<JsonLine> {
    let unsealed = unsealed_line(line)?;
    let text = String::from_utf8(line.to_vec()).ok()?;
    let value: Value = serde_json::from_str(&unsealed.text).ok()?;
    Some(JsonLine { step: value["step"].as_u64()?, text, value, had_seal: unsealed.had_seal })
}

/// Appends one line with its checksum, with one write.
///
/// # Errors
///
/// The operating system refuses.
pub fn append_json_line(path: &Path, line: &Value) -> io::Result<()> {
    DiskFile::append(path)?.write_all(format!("{}\n", seal_json(&line.to_string())).as_bytes())
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use serde_json::json;

    use super::*;
    use crate::tensorboard::testing::events_after_the_header;

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

    const UPDATES: u64 = 4;

    /// Returns the warning about a log that should have four updates of 8 steps.
    fn said(path: &Path) -> Option<String> {
        gaps(&JsonLines::read(path).expect("readable"), 8 * UPDATES, UPDATES)
    }

    fn written(path: &Path) -> Vec<u8> {
        for update in 1..=UPDATES {
            append_json_line(path, &json!({ "step": 8 * update, "charts/a": 0.25 })).expect("writable");
        }
        fs::read(path).expect("written")
    }

    #[test]
    fn wherever_a_log_is_cut_off_what_is_missing_is_said() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jsonl");
        let whole = written(&path);
        assert_eq!(said(&path), None);
        let ends: Vec<usize> = (0..whole.len()).filter(|at| whole[*at] == b'\n').collect();
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).expect("writable");
            // Without its line feed a line is whole.
            let kept = ends.iter().filter(|end| length >= **end).count() as u64;
            let words = said(&path);
            if kept == UPDATES {
                assert_eq!(words, None, "{length} bytes");
                continue;
            }
            let words = words.unwrap_or_else(|| panic!("{length} bytes: nothing is said"));
            let gap = match kept {
                3 => "metrics are missing for the update of step 32: ".to_owned(),
                kept => format!(
                    "metrics are missing for {} updates, those of the steps {} to 32: ",
                    UPDATES - kept,
                    8 * (kept + 1)
                ),
            };
            assert!(words.contains(&gap), "{length} bytes: {words}");
            let is_torn = !whole[..length].is_empty() && !ends.contains(&(length - 1)) && !ends.contains(&length);
            assert_eq!(words.contains(&format!("line {} is damaged", kept + 1)), is_torn, "{length} bytes: {words}");
        }
        fs::remove_file(&path).expect("removed");
        let words = said(&path).expect("it is gone");
        assert!(words.starts_with("metrics are missing for 4 updates, those of the steps 8 to 32: curves"), "{words}");
    }

    #[test]
    fn lines_that_are_missing_in_the_middle_are_said_as_well() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jsonl");
        let text = String::from_utf8(written(&path)).expect("text");
        let lines: Vec<&str> = text.lines().collect();
        fs::write(&path, format!("{}\n{}\n", lines[1], lines[3])).expect("writable");
        let words = said(&path).expect("two are missing");
        assert!(words.starts_with("metrics are missing for 2 updates, those of the steps 8, 24: "), "{words}");
        fs::write(&path, format!("{}\n{}\nx\n{}\n", lines[0], lines[1], lines[3])).expect("writable");
        let words = said(&path).expect("one is damaged");
        assert!(
            words.starts_with("line 3 is damaged and left out; metrics are missing for the update of step 24"),
            "{words}"
        );
    }

    #[test]
    fn what_a_kill_tore_behind_the_step_is_not_spoken_of() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jsonl");
        let torn = [written(&path), b"{\"crc32\":\"12".to_vec()].concat();
        fs::write(&path, torn).expect("writable");
        assert_eq!(said(&path), None);
        assert_eq!(gaps(&JsonLines::default(), 0, 0), None, "nothing was learned yet");
    }

    #[test]
    fn of_many_gaps_the_first_are_named() {
        let even: Vec<u64> = (1..=20).map(|update| 2 * update).collect();
        let words = of_updates(even, 10).expect("missing");
        assert_eq!(words, "20 updates, those of the steps 20, 40, 60, 80, 100, 120, 140, 160 and others");
        let words = missing(&JsonLines::default(), 17, 4).expect("missing");
        assert!(words.starts_with("metrics are missing for 4 of 4 updates: "), "{words}");
    }

    #[test]
    fn torn_lines_are_named_and_the_others_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jsonl");
        assert_eq!(JsonLines::read(&path).expect("empty"), JsonLines::default());
        append_json_line(&path, &json!({ "step": 8, "a": 0.1 })).expect("writable");
        let mut bytes = fs::read(&path).expect("written");
        bytes.extend(b"{\"step\": 16}\n{\"a\": 1}\n{\"step\":24,\"a\":\xff");
        fs::write(&path, bytes).expect("writable");
        let read = JsonLines::read(&path).expect("readable");
        assert_eq!(read.lines.iter().map(|line| line.step).collect::<Vec<_>>(), [8, 16]);
        assert_eq!((&read.lines[0].value, read.lines[0].had_seal), (&json!({ "step": 8, "a": 0.1 }), true));
        assert!(!read.lines[1].had_seal && read.is_torn);
        assert_eq!(read.damaged, [3, 4], "without a step; torn within a character");
    }
    #[test]
    fn no_flipped_bit_is_accepted() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.jsonl");
        for step in [8, 16] {
            append_json_line(&path, &json!({ "step": step, "charts/a": 0.25 })).expect("writable");
        }
        let whole = fs::read(&path).expect("written");
        let lines = JsonLines::read(&path).expect("readable").lines;
        for at in 0..(whole.len() - 1) * 8 {
            let mut bytes = whole.clone();
            bytes[at / 8] ^= 1 << (at % 8);
            fs::write(&path, bytes).expect("writable");
            let read = JsonLines::read(&path).expect("readable");
            assert!(read.lines.iter().all(|line| lines.contains(line)) && !read.damaged.is_empty(), "bit {at}");
        }
    }
}
