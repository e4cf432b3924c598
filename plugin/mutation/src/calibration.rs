//! The comparison of test results with recordings of people: do levels that are hard for bots cost people time and
//! lives, too?
//!
//! [`Calibration::read`] takes the results of a test and recordings of people on the same levels. For each level it has
//! [`LevelNumbers`] of the people and of every tester. For every tester and [`Measure`] it has an [`Agreement`]: rank
//! correlations over the levels, with 95 % intervals.
//!
//! ```
//! use playbot_mutation::calibration::spearman;
//!
//! // Seconds that people took on ten levels, and a bot.
//! let people = [12.0, 9.0, 30.0, 14.0, 55.0, 21.0, 17.0, 40.0, 11.0, 26.0];
//! let bot = [4.0, 3.5, 9.0, 6.0, 20.0, 5.0, 7.0, 15.0, 3.0, 8.0];
//! let found = spearman(&people, &bot).expect("both vary");
//! assert!(found.value > 0.9 && found.interval.is_some_and(|[low, _]| low > 0.6));
//! ```
//!
//! The folder, in reading order:
//!
//! - `rank`: rank correlations, Spearman's and Kendall's.
//! - `page`: the page of a calibration, as HTML with charts and as Markdown.

mod page;
mod rank;

use crate::calibration::page::LevelNames;
use bevy_playbot::{
    demo::file::{Decider, DemoEnd, DemoEpisode, DemoFileError, DemoHeader, DemoReader},
    engine::find_demos,
};
use playbot_harness::{game::Game, level_files::LevelFileError, split::LevelSplit};
use playbot_report::{counted, statistics::median};
use playbot_test::verdict::{EpisodeScore, LevelVerdict, ResultLines, TestError, TestRecord};
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};
use thiserror::Error;

pub use crate::calibration::rank::{RankCorrelation, kendall, spearman};

/// Most levels that the error of no shared level names.
const MOST_NAMED: usize = 4;

/// The results of testers and people on the same levels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// Name of the game.
    pub game: String,
    /// Version of its rules.
    pub game_version: u32,
    /// The levels that were tested.
    pub range: LevelSplit,
    /// Names of the testers.
    pub testers: Vec<String>,
    /// Names of the people, or names of the recordings without one.
    pub people: Vec<String>,
    /// Levels that were tested and not recorded.
    pub only_tested: u64,
    /// Levels that were recorded and not tested.
    pub only_recorded: u64,
    /// Counts of recorded episodes that do not count, in words.
    pub left_out: Vec<String>,
    /// The agreement of each tester with people, measure by measure.
    pub agreements: Vec<Agreement>,
    /// The levels that both testers and people have played, in the order of the results.
    pub levels: Vec<CalibratedLevel>,
}

impl Calibration {
    /// Compares the results in a folder with recordings of people, or folders of them. Level files are identified by
    /// the hash of their level, which needs the game.
    ///
    /// Only episodes that a person has played to their end count. A person is identified by the name in the recording
    /// (`playbot play --name`).
    ///
    /// # Errors
    ///
    /// [`CalibrationError`]: a file is missing or damaged, recordings are of another game, version or other levels, or
    /// there is no episode of a person.
    pub fn read(results: &Path, recordings: &[PathBuf], game: Option<&dyn Game>) -> Result<Self, CalibrationError> {
        let mut lines = ResultLines::open(results)?;
        let record = lines.record().clone();
        let names = LevelNames::of(results, &record, game)?;
        let people = People::read(recordings, results, &record, &names)?;
        let testers: Vec<String> = record.testers.iter().map(|tester| tester.name.clone()).collect();
        let (mut levels, mut only_tested, mut persons) = (Vec::new(), 0, BTreeSet::new());
        while let Some(verdict) = lines.next_level()? {
            let Some(tries) = people.levels.get(&verdict.level) else {
                only_tested += 1;
                continue;
            };
            persons.extend(tries.people().map(str::to_owned));
            levels.push(CalibratedLevel {
                persons: tries.people().count() as u64,
                people: tries.numbers(),
                testers: testers.iter().map(|name| of_tester(&verdict, name)).collect(),
                level: verdict.level,
            });
        }
        if levels.is_empty() {
            let (results, tested) = (results.to_owned(), record.range.to_string());
            return Err(CalibrationError::NoSharedLevel { recorded: named(&people), results, tested });
        }
        let agreement = |(tester, name): (usize, &String)| {
            Measure::ALL.map(|measure| Agreement::of(measure, name, tester, &levels))
        };
        let agreements = testers.iter().enumerate().flat_map(agreement).collect();
        Ok(Self {
            game: record.game,
            game_version: record.game_version,
            range: record.range,
            only_tested,
            only_recorded: people.levels.len().saturating_sub(levels.len()) as u64,
            left_out: people.left_out(),
            people: persons.into_iter().collect(),
            agreements,
            testers,
            levels,
        })
    }
}

/// A level that both people and testers have played.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibratedLevel {
    /// Its name in the results.
    pub level: String,
    /// Number of people who played it.
    pub persons: u64,
    /// Results of people. Each person counts once, for any number of tries.
    pub people: LevelNumbers,
    /// Results of each tester, in the order of the results.
    pub testers: Vec<LevelNumbers>,
}

fn of_tester(verdict: &LevelVerdict, name: &str) -> LevelNumbers {
    let found = verdict.testers.iter().find(|tester| tester.tester == *name);
    let none = LevelNumbers { tries: 0, completion: 0.0, ticks: None, deaths: 0.0 };
    found.map_or(none, |tester| LevelNumbers::of_score(&tester.score))
}

/// Returns the names of the first few levels that people played.
fn named(people: &People) -> String {
    let names: Vec<&str> = people.levels.keys().take(MOST_NAMED).map(String::as_str).collect();
    let more = people.levels.len().saturating_sub(MOST_NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{more}", names.join(", "))
}

// The agreement of testers and people on which levels are hard.

/// Levels that an interval needs to be narrow enough to be useful.
pub const FEW_LEVELS: usize = 10;

/// A number that is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// Share of tries that reached the goal.
    Completion,
    /// Median ticks of the tries that reached it.
    Time,
    /// Deaths in a try.
    Deaths,
}

impl Measure {
    /// All measures.
    pub const ALL: [Self; 3] = [Self::Completion, Self::Time, Self::Deaths];

    /// Returns the name for reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Completion => "completion",
            Self::Time => "time",
            Self::Deaths => "deaths",
        }
    }

    /// Returns the number; `None` if there is none, such as the time on a level that was never completed.
    pub fn of(self, numbers: &LevelNumbers) -> Option<f64> {
        match self {
            Self::Completion => Some(numbers.completion),
            Self::Time => numbers.ticks,
            Self::Deaths => Some(numbers.deaths),
        }
    }

    /// Returns the numbers of people and of a tester on each level that has both.
    fn pairs(self, levels: &[CalibratedLevel], tester: usize) -> Vec<(f64, f64)> {
        let pair = |level: &CalibratedLevel| self.of(&level.people).zip(self.of(level.testers.get(tester)?));
        levels.iter().filter_map(pair).collect()
    }
}

/// The rank correlations of a tester and people.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// The tester.
    pub tester: String,
    /// The measure.
    pub measure: Measure,
    /// Levels that have a number of both.
    pub levels: usize,
    /// Spearman's rank correlation, if both vary.
    pub spearman: Option<RankCorrelation>,
    /// Kendall's tau-b, if both vary.
    pub kendall: Option<RankCorrelation>,
    /// A caveat about these numbers.
    pub note: Option<String>,
}

impl Agreement {
    /// Computes the agreement of a tester and people on these levels.
    fn of(measure: Measure, name: &str, tester: usize, levels: &[CalibratedLevel]) -> Self {
        let pairs = measure.pairs(levels, tester);
        let (people, bots): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
        let spearman = spearman(&people, &bots);
        let note = note(measure, &people, &bots, spearman);
        let (tester, levels) = (name.to_owned(), people.len());
        Self { tester, measure, levels, spearman, kendall: kendall(&people, &bots), note }
    }
}

fn note(measure: Measure, people: &[f64], bots: &[f64], found: Option<RankCorrelation>) -> Option<String> {
    let is_one = |values: &[f64]| values.windows(2).all(|pair| pair[0] == pair[1]);
    let count = people.len();
    Some(match found {
        None if count == 0 => format!("no level has a {} of both", measure.name()),
        None if count == 1 => "one level has no order".to_owned(),
        None if is_one(people) && is_one(bots) => "both have the same number on all levels".to_owned(),
        None if is_one(people) => "people have the same number on all levels: nothing to agree with".to_owned(),
        None => "the tester has the same number on all levels".to_owned(),
        Some(RankCorrelation { interval: None, .. }) if count < 4 => "too few levels for an interval".to_owned(),
        Some(RankCorrelation { interval: None, .. }) => {
            format!("the same or the reversed order on all {count} levels: the formula has no interval for that")
        }
        Some(_) if count < FEW_LEVELS => format!("only {count} levels: the interval says little"),
        Some(_) => return None,
    })
}

// The tries of people in recordings.

/// Name of the person in a recording without a name.
const NAMELESS: &str = "human";

/// Tries of people, by level.
#[derive(Default)]
struct People {
    pub levels: BTreeMap<String, LevelTries>,
    /// Episodes that a bot played, or a policy.
    by_others: u64,
    /// Episodes that were left before their end.
    unfinished: u64,
}

impl People {
    /// Reads the tries in these recordings, or in all recordings of a folder.
    pub fn read(
        recordings: &[PathBuf],
        results: &Path,
        record: &TestRecord,
        names: &LevelNames,
    ) -> Result<Self, CalibrationError> {
        let mut people = Self::default();
        // A file that is named twice counts once.
        let mut files = BTreeSet::new();
        for path in recordings {
            files.extend(find_demos(path)?);
        }
        for path in &files {
            let reader = DemoReader::open(path)?;
            let header = reader.header().clone();
            check(path, &header, results, record)?;
            let person = person(&header, path);
            for episode in reader {
                people.add(&person, &header, &episode?, names);
            }
        }
        if people.levels.is_empty() {
            let files: Vec<String> = recordings.iter().map(|path| path.display().to_string()).collect();
            return Err(CalibrationError::NoPerson { files: files.join(", "), left_out: people.left_out() });
        }
        Ok(people)
    }

    fn add(&mut self, person: &str, header: &DemoHeader, episode: &DemoEpisode, names: &LevelNames) {
        if episode.is_empty() {
            return;
        }
        let by_hand = episode.deciders.iter().filter(|decider| **decider == Decider::Human).count();
        // A bot may have helped, but not played most of the episode.
        if 2 * by_hand <= episode.len() {
            self.by_others += 1;
            return;
        }
        let Some(one) = Try::of(episode) else {
            self.unfinished += 1;
            return;
        };
        for name in names.of_episode(header, episode) {
            self.levels.entry(name).or_default().add(person, one);
        }
    }

    /// Returns the counts of episodes that do not count, in words.
    pub fn left_out(&self) -> Vec<String> {
        let words = |count: u64, what: &str| (count > 0).then(|| format!("{} {what}", counted(count, "episode")));
        let (others, unfinished) = (self.by_others, self.unfinished);
        [words(others, "not played by a person"), words(unfinished, "left in the middle")]
            .into_iter()
            .flatten()
            .collect()
    }
}

fn check(path: &Path, header: &DemoHeader, results: &Path, record: &TestRecord) -> Result<(), CalibrationError> {
    let (path, results, game) = (path.to_owned(), results.to_owned(), record.game.clone());
    if header.game != game {
        return Err(CalibrationError::OtherGame { path, found: header.game.clone(), results, game });
    }
    let (found, version) = (header.game_version, record.game_version);
    if found == version { Ok(()) } else { Err(CalibrationError::OtherVersion { path, found, results, version, game }) }
}

/// Returns the person's name, or the file's if the recording has no name.
fn person(header: &DemoHeader, path: &Path) -> String {
    let name = header.demonstrator.trim();
    if name.is_empty() || name == NAMELESS { path.display().to_string() } else { name.to_owned() }
}

// Errors of comparing results with recordings.

/// The reason why results cannot be compared with recordings.
#[derive(Debug, Error)]
pub enum CalibrationError {
    /// The results cannot be read.
    #[error(transparent)]
    Results(#[from] TestError),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] DemoFileError),
    /// The level files of the results cannot be read.
    #[error(transparent)]
    Files(#[from] LevelFileError),
    /// A recording is of another game.
    #[error(
        "{}: a recording of the game `{found}`, but {} are results of `{game}`: name recordings of `{game}`",
        path.display(), results.display()
    )]
    OtherGame {
        /// The recording.
        path: PathBuf,
        /// Its game.
        found: String,
        /// The folder of the results.
        results: PathBuf,
        /// Their game.
        game: String,
    },
    /// A recording is of another version of the game.
    #[error(
        "{}: recorded with version {found} of `{game}`, but {} were tested with version {version}: people and bots had other \
         rules; record people again, or test with that version", path.display(), results.display()
    )]
    OtherVersion {
        /// The recording.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// The folder of the results.
        results: PathBuf,
        /// Their version.
        version: u32,
        /// The game.
        game: String,
    },
    /// The levels of the results are files, and only the game can compute their hashes.
    #[error(
        "the levels of {} are files, which the program of `{game}` must read to know them in recordings: use that program",
        results.display()
    )]
    NoGame {
        /// The folder of the results.
        results: PathBuf,
        /// Their game.
        game: String,
    },
    /// The files contain other levels than the tested ones.
    #[error(
        "the level files of {} ({range}) changed since the test: bring them back, run this in the folder in which they were \
         tested, or test them again", results.display()
    )]
    ChangedFiles {
        /// The folder of the results.
        results: PathBuf,
        /// The levels.
        range: String,
    },
    /// No person played an episode to its end.
    #[error(
        "no episode of {files} was played by a person to its end{}: record people with `playbot play GAME --record people.demo`",
        why(left_out)
    )]
    NoPerson {
        /// The recordings.
        files: String,
        /// Counts of the episodes that do not count, each in words.
        left_out: Vec<String>,
    },
    /// People and testers played different levels.
    #[error(
        "no level is in both: people played {recorded}, and {} have {tested}: test the levels that people played, or record \
         people on these", results.display()
    )]
    NoSharedLevel {
        /// Levels of the recordings.
        recorded: String,
        /// The folder of the results.
        results: PathBuf,
        /// Their levels.
        tested: String,
    },
}

fn why(left_out: &[String]) -> String {
    if left_out.is_empty() { String::new() } else { format!(" ({})", left_out.join(", ")) }
}

// The numbers of a level that are compared, and the tries of people on it.

/// The results of a tester, or of people, on a level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LevelNumbers {
    /// Episodes.
    pub tries: u64,
    /// Share of the tries that reached the goal.
    pub completion: f64,
    /// Median ticks of the tries that reached it, if there are any.
    pub ticks: Option<f64>,
    /// Deaths in a try: the share of tries that the game ended before the goal.
    pub deaths: f64,
}

impl LevelNumbers {
    /// Returns the numbers of a tester.
    fn of_score(score: &EpisodeScore) -> Self {
        let share = |count: u64| if score.episodes == 0 { 0.0 } else { count as f64 / score.episodes as f64 };
        Self {
            tries: score.episodes,
            completion: share(score.solved),
            ticks: score.ticks.map(|ticks| ticks.median),
            deaths: share(score.lost),
        }
    }

    /// Returns the numbers of several people: means, and the median of their times.
    fn of_people(people: &[Self]) -> Self {
        let mean = |value: fn(&Self) -> f64| people.iter().map(value).sum::<f64>() / people.len().max(1) as f64;
        Self {
            tries: people.iter().map(|person| person.tries).sum(),
            completion: mean(|person| person.completion),
            ticks: median(people.iter().filter_map(|person| person.ticks).collect()),
            deaths: mean(|person| person.deaths),
        }
    }
}

/// Tries on one level, by person.
#[derive(Clone, Debug, Default)]
struct LevelTries(BTreeMap<String, Vec<Try>>);

impl LevelTries {
    /// Adds a try.
    pub fn add(&mut self, person: &str, one: Try) {
        self.0.entry(person.to_owned()).or_default().push(one);
    }

    /// Returns the names of the people.
    pub fn people(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// Returns the numbers of these people.
    pub fn numbers(&self) -> LevelNumbers {
        let people: Vec<LevelNumbers> = self.0.values().map(|tries| of_person(tries)).collect();
        LevelNumbers::of_people(&people)
    }
}

fn of_person(tries: &[Try]) -> LevelNumbers {
    let share = |end: TryEnd| tries.iter().filter(|one| one.end == end).count() as f64 / tries.len().max(1) as f64;
    let completed = tries.iter().filter(|one| one.end == TryEnd::Completed);
    LevelNumbers {
        tries: tries.len() as u64,
        completion: share(TryEnd::Completed),
        ticks: median(completed.map(|one| one.ticks as f64).collect()),
        deaths: share(TryEnd::Died),
    }
}

/// A try with a known end.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Try {
    end: TryEnd,
    ticks: u64,
}

impl Try {
    /// Returns the try; `None` for an episode that was left before its end, since its outcome is unknown.
    pub fn of(episode: &DemoEpisode) -> Option<Self> {
        let end = match episode.end {
            DemoEnd::Terminated { success: true } => TryEnd::Completed,
            DemoEnd::Terminated { success: false } => TryEnd::Died,
            DemoEnd::Truncated => TryEnd::TimedOut,
            DemoEnd::Aborted => return None,
        };
        Some(Self { end, ticks: episode.len() as u64 })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TryEnd {
    Completed,
    Died,
    TimedOut,
}

#[cfg(test)]
mod tests {

    use super::*;

    /// Levels on which people and a tester complete these shares.
    fn agreement(people: &[f64], bot: &[f64]) -> Agreement {
        let numbers = |completion| LevelNumbers { tries: 4, completion, ticks: None, deaths: 0.0 };
        let level = |(people, bot): (&f64, &f64)| CalibratedLevel {
            level: "a".to_owned(),
            persons: 2,
            people: numbers(*people),
            testers: vec![numbers(0.5), numbers(*bot)],
        };
        let levels: Vec<CalibratedLevel> = people.iter().zip(bot).map(level).collect();
        Agreement::of(Measure::Completion, "ppo", 1, &levels)
    }

    #[test]
    fn what_says_little_is_called_so() {
        let note = |people: &[f64], bot: &[f64]| agreement(people, bot).note.unwrap_or_default();
        assert_eq!(note(&[], &[]), "no level has a completion of both");
        assert!(note(&[0.5], &[0.5]).contains("one level"));
        assert!(note(&[0.5, 0.5], &[0.1, 0.2]).starts_with("people have the same number"));
        assert!(note(&[0.1, 0.2], &[0.5, 0.5]).starts_with("the tester has the same number"));
        assert!(note(&[0.5, 0.5], &[1.0, 1.0]).starts_with("both have the same number"));
        assert_eq!(note(&[0.1, 0.2, 0.3], &[0.1, 0.3, 0.2]), "too few levels for an interval");
        assert!(note(&[0.1, 0.2, 0.3, 0.4], &[0.1, 0.2, 0.3, 0.4]).starts_with("the same or the reversed order"));
        assert_eq!(note(&[0.1, 0.2, 0.3, 0.4], &[0.1, 0.3, 0.2, 0.4]), "only 4 levels: the interval says little");
        let ten: Vec<f64> = (0..10).map(f64::from).collect();
        let mut other = ten.clone();
        other.swap(2, 3);
        let found = agreement(&ten, &other);
        assert_eq!((found.note, found.levels), (None, 10));
        assert!(found.spearman.is_some_and(|found| found.interval.is_some()));
    }

    #[test]
    fn each_person_counts_once() {
        let person = |tries, completion, ticks, deaths| LevelNumbers { tries, completion, ticks, deaths };
        let all = [person(9, 1.0, Some(30.0), 0.0), person(1, 0.0, None, 1.0), person(2, 0.5, Some(50.0), 0.5)];
        assert_eq!(LevelNumbers::of_people(&all), person(12, 0.5, Some(40.0), 0.5));
        assert_eq!(LevelNumbers::of_people(&all[1..2]), all[1]);
    }
}
