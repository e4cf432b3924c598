//! The file `results.json`: the description of a test, and a line for each level.
//!
//! The file is one JSON object whose levels stand one to a line. So files of any length are read and joined without
//! holding them in memory.

#[cfg(test)]
mod tests;

use crate::{
    detectors::looks_after_play,
    verdict::{
        LevelOutcome, LevelVerdict, Places, TooShort,
        error::{JOURNAL, MAKE_AGAIN, TestError, io_error, json_fault},
        plan::{RECORD, TestRecord},
        statistics::Trials,
    },
};
use crc32fast::Hasher;
use playbot_learner::BrokenSeal;
use playbot_report::counted;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io,
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    time::Duration,
};

/// Name of the file in the folder of a test.
pub const RESULTS: &str = "results.json";

/// Text between the description and the first level.
const LEVELS: &str = ",\"levels\":[";

/// The fault of a file that was cut off.
const CUT: &str = "the file ends in the middle";

/// Text after the last level in files of older versions.
const END: &str = "]}";

/// Largest number of worst levels that are reported.
pub const MOST_WORST: usize = 20;

/// Largest number of hardest levels that are reported.
const MOST_HARDEST: usize = 5;

/// The levels of a `results.json`, in their order, as lines of JSON.
pub struct ResultLines {
    path: PathBuf,
    record: TestRecord,
    lines: io::Lines<BufReader<File>>,
    /// Number of lines read so far.
    number: usize,
    is_over: bool,
    /// Checksum of the lines read so far.
    hasher: Hasher,
}

impl ResultLines {
    /// Opens the results in a folder.
    ///
    /// # Errors
    ///
    /// [`TestError::NoResults`] without results; [`TestError::Damaged`] if they differ from the form of
    /// [`TestFolder`](crate::verdict::TestFolder).
    pub fn open(folder: &Path) -> Result<Self, TestError> {
        let path = folder.join(RESULTS);
        let file = File::open(&path).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
                TestError::NoResults { folder: folder.into(), resumed: unfinished(folder) }
            }
            _ => TestError::Io { action: "read", path: path.clone(), source },
        })?;
        let mut lines = BufReader::new(file).lines();
        let head = lines.next().transpose().map_err(io_error("read", &path))?.unwrap_or_default();
        let mut hasher = Hasher::new();
        hash_line(&mut hasher, &head);
        let record = head.strip_suffix(LEVELS).map(|record| serde_json::from_str(&format!("{record}}}")));
        let (message, next) = match record {
            Some(Ok(record)) => return Ok(Self { path, record, lines, number: 1, is_over: false, hasher }),
            Some(Err(error)) => (json_fault(&error), MAKE_AGAIN),
            None if head.trim() == "{" => (
                "the line breaks are not those of `playbot test`, whose results are read line by line".to_owned(),
                "keep the file as it was written, and format a copy",
            ),
            None => (
                "the file is torn, or holds no results".to_owned(),
                "`test --resume` writes it anew from the levels that are done, and `test --force` plays all of them again",
            ),
        };
        Err(TestError::Damaged { path, line: 1, message, next })
    }

    /// Opens the results as [`open`](Self::open) does, after a check of the checksum over the whole file.
    ///
    /// # Errors
    ///
    /// As for [`open`](Self::open); and the file is incomplete, or its checksum is wrong.
    pub fn open_whole(folder: &Path) -> Result<Self, TestError> {
        let mut lines = Self::open(folder)?;
        while lines.next_line()?.is_some() {}
        Self::open(folder)
    }

    /// Returns the description of the test.
    pub fn record(&self) -> &TestRecord {
        &self.record
    }

    /// Returns the line of the next level; `None` after the last one.
    ///
    /// # Errors
    ///
    /// The file is incomplete, or cannot be read.
    pub fn next_line(&mut self) -> Result<Option<String>, TestError> {
        if self.is_over {
            return Ok(None);
        }
        let line = self.lines.next().transpose().map_err(io_error("read", &self.path))?;
        self.number += 1;
        match line {
            // No level begins so.
            Some(line) if line.starts_with(']') => {
                if line != END && line != end(&self.hasher) {
                    return Err(self.damaged(&BrokenSeal.to_string()));
                }
                if self.lines.next().is_some() {
                    self.number += 1;
                    return Err(self.damaged("the file goes on after its end"));
                }
                self.is_over = true;
                Ok(None)
            }
            Some(line) => {
                hash_line(&mut self.hasher, &line);
                Ok(Some(line.strip_suffix(',').unwrap_or(&line).to_owned()))
            }
            None => Err(self.damaged(CUT)),
        }
    }

    /// Returns the next level; `None` after the last one.
    ///
    /// # Errors
    ///
    /// The file is incomplete, is malformed, or cannot be read.
    pub fn next_level(&mut self) -> Result<Option<LevelVerdict>, TestError> {
        let Some(line) = self.next_line()? else { return Ok(None) };
        serde_json::from_str(&line).map(Some).map_err(|error| self.malformed(&error))
    }

    /// Returns the line of the next level, which must have this index in the range.
    ///
    /// # Errors
    ///
    /// The next level is another one, or missing.
    pub(super) fn line_of(&mut self, index: u64) -> Result<String, TestError> {
        let line = self.next_line()?.ok_or_else(|| self.damaged("levels are missing"))?;
        let found = serde_json::from_str::<Value>(&line).map_err(|error| self.malformed(&error))?;
        match found["index"].as_u64() {
            Some(found) if found == index => Ok(line),
            _ => Err(self.damaged(&format!("this is not the level with index {index}"))),
        }
    }

    /// Reads the end, which nothing may follow: the checksum there confirms the levels before it.
    ///
    /// # Errors
    ///
    /// Another level follows, or the checksum is wrong.
    pub(super) fn expect_end(&mut self) -> Result<(), TestError> {
        match self.next_line()? {
            None => Ok(()),
            Some(_) => Err(self.damaged("there are more levels than were tested")),
        }
    }

    /// Returns the error of a line that is no level. The end of a file that was cut off is reported as by readers that do
    /// not parse the line.
    fn malformed(&mut self, error: &serde_json::Error) -> TestError {
        if error.is_eof() && self.lines.next().is_none() {
            self.number += 1;
            return self.damaged(CUT);
        }
        self.damaged(&json_fault(error))
    }

    fn damaged(&self, message: &str) -> TestError {
        let (path, message) = (self.path.clone(), message.to_owned());
        TestError::Damaged { path, line: self.number, message, next: MAKE_AGAIN }
    }
}

/// Returns the command that goes on with the test that was begun in a folder; `None` without one.
fn unfinished(folder: &Path) -> Option<String> {
    let record = TestRecord::read(&folder.join(RECORD)).ok().filter(|_| folder.join(JOURNAL).exists())?;
    Some(record.resumed_in(folder))
}

/// Writer of results, a level at a time.
pub(super) struct ResultWriter<W> {
    out: W,
    is_first: bool,
    hasher: Hasher,
}

impl<W: Write> ResultWriter<W> {
    /// Begins with the description of the test.
    pub fn begin(out: W, record: &TestRecord) -> io::Result<Self> {
        let head = serde_json::to_string(record)?;
        let mut results = Self { out, is_first: true, hasher: Hasher::new() };
        // The record is an object that is not empty, and goes on.
        results.write(&format!("{}{LEVELS}\n", head.strip_suffix('}').unwrap_or(&head)))?;
        Ok(results)
    }

    /// Adds a level, as a line of JSON without line feed.
    pub fn push(&mut self, line: &str) -> io::Result<()> {
        let separator = if self.is_first { "" } else { ",\n" };
        self.is_first = false;
        self.write(&format!("{separator}{line}"))
    }

    /// Ends the file.
    pub fn end(mut self) -> io::Result<()> {
        let line_feed = if self.is_first { "" } else { "\n" };
        self.write(line_feed)?;
        let end = end(&self.hasher);
        writeln!(self.out, "{end}")
    }

    fn write(&mut self, text: &str) -> io::Result<()> {
        self.hasher.update(text.as_bytes());
        self.out.write_all(text.as_bytes())
    }
}

/// Returns the folder of results, given the folder or the file in it.
pub fn results_folder(named: &Path) -> &Path {
    let is_file = named.file_name().is_some_and(|name| name == RESULTS) && named.is_file();
    match named.parent() {
        Some(folder) if is_file && folder.as_os_str().is_empty() => Path::new("."),
        Some(folder) if is_file => folder,
        _ => named,
    }
}

/// Returns the text after the last level, with the checksum of all bytes of the lines before.
fn end(hasher: &Hasher) -> String {
    format!("],\"crc32\":\"{:08x}\"}}", hasher.clone().finalize())
}

fn hash_line(hasher: &mut Hasher, line: &str) {
    hasher.update(line.as_bytes());
    hasher.update(b"\n");
}

// Totals of a test.

/// Most levels that are named in a line.
const MOST_NAMES: usize = 5;

/// Totals of a tester over all levels.
#[derive(Clone, Debug, PartialEq)]
pub struct TesterTotal {
    /// Its name.
    pub name: String,
    /// Levels that it solved at least once, among all.
    pub levels: Trials,
    /// Episodes that it solved, among all.
    pub episodes: Trials,
    /// Open squares that it visited, over all levels with maps.
    pub places: Places,
}

/// Levels that a recording of an earlier build solves, in the order of the range.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordedTotal {
    /// Number of these levels.
    pub levels: u64,
    /// Those whose recorded actions no longer end as they were recorded to, described.
    pub regressions: Vec<String>,
    /// Those whose actions end so after another course, or where no tester reaches the goal, described.
    pub others: Vec<String>,
}

impl RecordedTotal {
    fn add(&mut self, level: &LevelVerdict) {
        self.levels += u64::from(level.recorded.is_some());
        let Some(news) = level.recorded_news() else { return };
        let list = if level.is_regression() { &mut self.regressions } else { &mut self.others };
        list.push(format!("{}: {news}", level.title()));
    }

    /// Returns a sentence about all of these levels, without a full stop; `None` without such levels.
    pub fn summary(&self) -> Option<String> {
        let levels = counted(self.levels, "recorded level");
        match (self.levels, self.regressions.len()) {
            (0, _) => None,
            (_, 0) => Some(format!("{levels}: all end as recorded")),
            (_, count) => {
                Some(format!("{levels}: {count} no longer {} as recorded", if count == 1 { "ends" } else { "end" }))
            }
        }
    }
}

/// Totals of all results, and the worst levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Overview {
    /// Description of the test.
    pub record: TestRecord,
    /// Number of levels.
    pub levels: u64,
    /// Levels that were solved.
    pub solved: u64,
    /// Levels without a success and without a proof.
    pub bot_failed: u64,
    /// Levels whose goal cannot be reached.
    pub proved_unsolvable: u64,
    /// Levels that are solved in their first tick, in every episode.
    pub solved_at_start: u64,
    /// The names of the first few of these.
    pub first_solved_at_start: Vec<String>,
    /// Levels that are not [sound](LevelVerdict::is_sound).
    pub unsound: u64,
    /// Findings of all levels.
    pub findings: u64,
    /// Time of all levels in the game; `None` if none is known.
    pub time: Option<Duration>,
    /// Open squares that any tester visited, over all levels with maps.
    pub places: Places,
    /// The testers, in the order of the test.
    pub testers: Vec<TesterTotal>,
    /// At most 20 levels that are not [sound](LevelVerdict::is_sound), the worst ones first.
    pub worst: Vec<LevelVerdict>,
    /// At most 5 sound levels that were solved in a smaller share of their episodes than at least half of the solved
    /// levels, the hardest ones first.
    pub hardest: Vec<LevelVerdict>,
    /// Levels of a recording of an earlier build, in a test against one.
    pub recorded: RecordedTotal,
    /// Detectors that could find nothing on any level, because all episodes were too short.
    pub too_short: Vec<TooShort>,
}

impl Overview {
    /// Reads the results in a folder.
    ///
    /// # Errors
    ///
    /// The folder has no results, or they are damaged.
    pub fn read(folder: &Path) -> Result<Self, TestError> {
        let mut lines = ResultLines::open(folder)?;
        let mut overview = Self::empty(lines.record().clone());
        let mut shares = BTreeMap::<u64, u64>::new();
        let mut short = ShortTotals::default();
        while let Some(level) = lines.next_level()? {
            short.add(&level);
            if level.outcome == LevelOutcome::Solved {
                *shares.entry(solved_share(&level)).or_default() += 1;
            }
            overview.add(level);
        }
        overview.keep_hardest(&shares);
        overview.too_short = short.everywhere();
        Ok(overview)
    }

    fn empty(record: TestRecord) -> Self {
        let places = Places::default();
        let total = |name: &String| TesterTotal {
            name: name.clone(),
            levels: Trials::default(),
            episodes: Trials::default(),
            places,
        };
        let testers = record.testers.iter().map(|tester| total(&tester.name)).collect();
        Self {
            record,
            levels: 0,
            solved: 0,
            bot_failed: 0,
            proved_unsolvable: 0,
            solved_at_start: 0,
            first_solved_at_start: Vec::new(),
            unsound: 0,
            findings: 0,
            time: None,
            places,
            testers,
            worst: Vec::new(),
            hardest: Vec::new(),
            recorded: RecordedTotal::default(),
            too_short: Vec::new(),
        }
    }

    fn add(&mut self, level: LevelVerdict) {
        self.levels += 1;
        self.unsound += u64::from(!level.is_sound());
        self.findings += level.findings.len() as u64;
        self.time = [self.time, level.time()].into_iter().flatten().reduce(Duration::saturating_add);
        self.places.add(level.places);
        if level.solved_at_start {
            self.solved_at_start += 1;
            if self.first_solved_at_start.len() < MOST_NAMES {
                self.first_solved_at_start.push(level.title());
            }
        }
        *match level.outcome {
            LevelOutcome::Solved => &mut self.solved,
            LevelOutcome::BotFailed => &mut self.bot_failed,
            LevelOutcome::ProvedUnsolvable => &mut self.proved_unsolvable,
        } += 1;
        for (total, tester) in self.testers.iter_mut().zip(&level.testers) {
            total.levels.trials += 1;
            total.levels.successes += u64::from(tester.score.solved > 0);
            let Trials { successes, trials } = &mut total.episodes;
            *trials = trials.saturating_add(tester.score.episodes);
            *successes = successes.saturating_add(tester.score.solved);
            total.places.add(tester.places);
        }
        self.recorded.add(&level);
        if level.is_perfect() {
            return;
        }
        let (list, most) = match level.is_sound() {
            true => (&mut self.hardest, MOST_HARDEST),
            false => (&mut self.worst, MOST_WORST),
        };
        let place = list.partition_point(|other| is_worse(other, &level));
        if place < most {
            list.insert(place, level);
            list.truncate(most);
        }
    }

    /// Keeps those of the hardest levels that are harder than at least half of the solved levels, given the numbers of
    /// solved levels by their share of solved episodes. A tester that never wins makes no level harder than the others.
    fn keep_hardest(&mut self, shares: &BTreeMap<u64, u64>) {
        let mut half = shares.values().sum::<u64>().div_ceil(2);
        let median = shares.iter().find_map(|(share, levels)| {
            half = half.saturating_sub(*levels);
            (half == 0).then_some(*share)
        });
        self.hardest.retain(|level| median.is_some_and(|median| solved_share(level) < median));
    }

    /// Returns a sentence about the levels that are solved in their first tick, without a full stop; `None` without such
    /// levels.
    pub fn first_tick(&self) -> Option<String> {
        let count = self.solved_at_start;
        let (are, their) = if count == 1 { ("is", "its") } else { ("are", "their") };
        let more = count.saturating_sub(self.first_solved_at_start.len() as u64);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let names = self.first_solved_at_start.join(", ");
        (count > 0).then(|| format!("{} {are} solved in {their} first tick: {names}{more}", counted(count, "level")))
    }

    /// Lists the detectors that could not look, because all episodes were too short, with what they need; `None` without
    /// such detectors.
    pub fn could_not_look(&self) -> Option<String> {
        let detectors: Vec<String> = self.too_short.iter().map(ToString::to_string).collect();
        (!detectors.is_empty()).then(|| detectors.join(", "))
    }

    /// Returns whether every level was solved, has no finding, and ends as recorded.
    pub fn is_sound(&self) -> bool {
        self.unsound == 0
    }
}

/// Detectors for which the episodes of levels were too short.
#[derive(Default)]
struct ShortTotals {
    /// Number of all levels, and of those on which the time of an episode was up.
    levels: u64,
    timed_out: u64,
    /// Each detector with its longest episode, and the number of levels on which that was too short.
    short: Vec<(TooShort, u64)>,
    /// Detectors with findings.
    found: BTreeSet<String>,
}

impl ShortTotals {
    fn add(&mut self, level: &LevelVerdict) {
        self.levels += 1;
        self.timed_out += u64::from(level.score.timed_out > 0);
        self.found.extend(level.findings.iter().map(|finding| finding.detector.clone()));
        for short in &level.too_short {
            match self.short.iter_mut().find(|(known, _)| known.detector == short.detector) {
                Some((known, levels)) => {
                    *levels += 1;
                    if known.had < short.had {
                        *known = short.clone();
                    }
                }
                None => self.short.push((short.clone(), 1)),
            }
        }
    }

    /// Returns the detectors that could find nothing on any level. Those that watch play say nothing of levels on which no
    /// time was up.
    fn everywhere(self) -> Vec<TooShort> {
        let Self { levels, timed_out, short, found } = self;
        let all = |detector: &str| if looks_after_play(detector) { levels } else { timed_out };
        let short = short.into_iter().filter(|(short, count)| *count == all(&short.detector));
        short.map(|(short, _)| short).filter(|short| !found.contains(&short.detector)).collect()
    }
}

/// Returns the share of solved episodes, in millionths.
fn solved_share(level: &LevelVerdict) -> u64 {
    let Trials { successes, trials } = level.score.trials();
    u64::try_from(u128::from(successes) * 1_000_000 / u128::from(trials.max(1))).unwrap_or(u64::MAX)
}

/// Returns whether a level is at least as bad as a later one of the range.
fn is_worse(level: &LevelVerdict, later: &LevelVerdict) -> bool {
    let rank = |level: &LevelVerdict| (level.outcome, level.findings.is_empty());
    let (one, other) = (level.score.trials(), later.score.trials());
    let shares = (u128::from(one.successes) * u128::from(other.trials))
        .cmp(&(u128::from(other.successes) * u128::from(one.trials)));
    rank(level).cmp(&rank(later)).then(shares).is_le()
}

/// Ticks of solved episodes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FinishTime {
    /// A quarter of the episodes took at most so many ticks.
    pub lower_quartile: f64,
    /// Half of the episodes took at most so many ticks.
    pub median: f64,
    /// Three quarters of the episodes took at most so many ticks.
    pub upper_quartile: f64,
}

impl FinishTime {
    /// Computes the quartiles of these episodes; `None` without episodes. Interpolates between two values (type 7 of
    /// Hyndman and Fan 1996, as in R's `quantile`).
    pub fn of(mut ticks: Vec<u32>) -> Option<Self> {
        ticks.sort_unstable();
        let last = ticks.len().checked_sub(1)?;
        let at = |share: f64| {
            let place = share * last as f64;
            let below = place.floor() as usize;
            let (low, high) = (f64::from(ticks[below]), f64::from(ticks[last.min(below + 1)]));
            low + (place - below as f64) * (high - low)
        };
        Some(Self { lower_quartile: at(0.25), median: at(0.5), upper_quartile: at(0.75) })
    }
}
