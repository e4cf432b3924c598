//! Reading results and recordings into a calibration.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::{
    agreement::{Agreement, Measure},
    error::CalibrationError,
    level_names::LevelNames,
    numbers::{CalibratedLevel, Numbers},
    people::People,
};
use crate::{
    game::Game,
    split::LevelSplit,
    verdict::{LevelVerdict, ResultLines},
};

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

fn of_tester(verdict: &LevelVerdict, name: &str) -> Numbers {
    let found = verdict.testers.iter().find(|tester| tester.tester == *name);
    let none = Numbers { tries: 0, completion: 0.0, ticks: None, deaths: 0.0 };
    found.map_or(none, |tester| Numbers::of_score(&tester.score))
}

/// Returns the names of the first few levels that people played.
fn named(people: &People) -> String {
    let names: Vec<&str> = people.levels.keys().take(MOST_NAMED).map(String::as_str).collect();
    let more = people.levels.len().saturating_sub(MOST_NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{more}", names.join(", "))
}
