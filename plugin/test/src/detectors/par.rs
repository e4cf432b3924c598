//! Pars: the ticks that levels should take.

use bevy_playbot::{
    demo::file::{DemoFileError, DemoReader},
    engine::find_demos,
    state_hash::StateHash,
};
use playbot_harness::{game::Game, level_files::read::read_text_file};
use std::{
    collections::BTreeMap,
    io,
    path::{Path, PathBuf},
    sync::Arc,
};
use thiserror::Error;

/// The pars of levels, by their names in results: `hard:7`, or the path of a level file.
#[derive(Clone, Debug, Default)]
pub struct Pars {
    ticks: Arc<BTreeMap<String, f64>>,
    path: PathBuf,
}

/// Pars from different files may be equal.
impl PartialEq for Pars {
    fn eq(&self, other: &Self) -> bool {
        self.ticks == other.ticks
    }
}

/// The reason why pars cannot be read.
#[derive(Debug, Error)]
pub enum ParError {
    /// The file is not a list of levels.
    #[error(
        "{}, line {line}, column {column}: {message}; write each level's name with its ticks, as in \
         {{\"hard:7\": 120, \"levels/cave.json\": 300}}", path.display()
    )]
    Text {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column.
        column: usize,
        /// The error.
        message: String,
    },
    /// A number of ticks is invalid.
    #[error("{}: the par of {level} is {ticks}: write ticks, more than 0", path.display())]
    Ticks {
        /// The file.
        path: PathBuf,
        /// The level.
        level: String,
        /// The value in the file.
        ticks: f64,
    },
    /// The file has no par.
    #[error(
        "{}: there is no par: list levels with their ticks, or name recordings in which they are solved",
        .0.display()
    )]
    None(PathBuf),
    /// A recording cannot be read.
    #[error(transparent)]
    Demo(#[from] DemoFileError),
    /// The system cannot read a file.
    #[error("cannot read {}: {source}; name a .json file with ticks, a recording or a folder of recordings", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

impl Pars {
    /// Reads pars. A `.json` file has an object with the ticks of each level by its name. From recordings of this game,
    /// a level's par is its fastest won episode.
    ///
    /// # Errors
    ///
    /// [`ParError`], also if there is no par at all.
    pub fn read(path: &Path, game: &dyn Game) -> Result<Self, ParError> {
        let is_text = path.extension().is_some_and(|ending| ending == "json");
        let pars = if is_text { of_text(path)? } else { of_recordings(path, game)? };
        if pars.is_empty() {
            return Err(ParError::None(path.into()));
        }
        Ok(Self { ticks: Arc::new(pars), path: path.into() })
    }

    /// Returns the par of a level.
    pub fn of(&self, level: &str) -> Option<f64> {
        self.ticks.get(level).copied()
    }

    /// Returns the names of the levels with a par.
    pub fn levels(&self) -> impl Iterator<Item = &str> {
        self.ticks.keys().map(String::as_str)
    }

    /// Returns the path that the pars were read from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns whether there is no par.
    pub fn is_empty(&self) -> bool {
        self.ticks.is_empty()
    }

    /// Returns a hash of all pars.
    pub fn hash(&self) -> u64 {
        let words = self.ticks.iter().flat_map(|(level, ticks)| {
            // A value that is no byte ends each name.
            level.bytes().map(u64::from).chain([u64::from(u8::MAX) + 1, ticks.to_bits()])
        });
        StateHash::of(words).0
    }
}

/// Largest size of a file of pars, bytes.
const MOST_BYTES: u64 = 32 << 20;

fn of_text(path: &Path) -> Result<BTreeMap<String, f64>, ParError> {
    let read = read_text_file(path, MOST_BYTES);
    let text = read.map_err(|error| ParError::Io { path: path.into(), source: error.into() })?;
    let pars: BTreeMap<String, f64> = serde_json::from_str(&text).map_err(|error| ParError::Text {
        path: path.into(),
        line: error.line(),
        column: error.column(),
        message: error.to_string(),
    })?;
    match pars.iter().find(|(_, ticks)| **ticks <= 0.0) {
        Some((level, ticks)) => Err(ParError::Ticks { path: path.into(), level: level.clone(), ticks: *ticks }),
        None => Ok(pars),
    }
}

fn of_recordings(path: &Path, game: &dyn Game) -> Result<BTreeMap<String, f64>, ParError> {
    let mut pars = BTreeMap::<String, f64>::new();
    for file in find_demos(path)? {
        let reader = DemoReader::open_for_game(&file, game.name(), game.version(), None)?;
        let mode = reader.header().mode.clone();
        for episode in reader {
            let episode = episode?;
            if !episode.is_success() {
                continue;
            }
            let seed = || format!("{mode}:{}", episode.level_seed);
            let name = episode.level_file.as_ref().map_or_else(seed, |file| file.path.clone());
            let ticks = episode.len() as f64;
            pars.entry(name).and_modify(|least| *least = least.min(ticks)).or_insert(ticks);
        }
    }
    Ok(pars)
}

#[cfg(test)]
mod tests {
    use bevy_playbot::action::{ActionSpace, Actions};
    use bevy_playbot::demo::file::{Decider, DemoEnd, DemoEpisode, DemoHeader, DemoWriter};

    use super::*;
    use playbot_harness::foreign::ForeignGame;
    use std::fs;

    fn garden() -> ForeignGame {
        ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {})
    }

    fn read(text: &str) -> Result<Pars, ParError> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("pars.json");
        fs::write(&path, text).expect("writable");
        Pars::read(&path, &garden())
    }

    #[test]
    fn pars_are_read_and_distinguished_by_their_hash() {
        let pars = read(r#"{"hard:7": 120, "levels/cave.json": 300.5}"#).expect("pars");
        assert_eq!(
            (pars.of("hard:7"), pars.of("levels/cave.json"), pars.of("hard:8")),
            (Some(120.0), Some(300.5), None)
        );
        assert_ne!(pars.hash(), read(r#"{"hard:7": 121, "levels/cave.json": 300.5}"#).expect("pars").hash());
        assert_eq!(pars, read(r#"{"levels/cave.json": 300.5, "hard:7": 120}"#).expect("pars"));
    }

    #[test]
    fn what_is_no_par_is_reported_with_its_place() {
        for (text, words) in [
            ("{\n\"hard:7\": soon}", "line 2"),
            ("[1, 2]", "\"hard:7\": 120"),
            (r#"{"hard:7": 0}"#, "the par of hard:7 is 0"),
            ("{}", "there is no par"),
        ] {
            let error = read(text).expect_err(text).to_string();
            assert!(error.contains("pars.json") && error.contains(words), "{error}");
        }
        let missing = Pars::read(Path::new("none.json"), &garden()).expect_err("missing").to_string();
        assert!(missing.contains("none.json") && missing.contains("recordings"), "{missing}");
    }

    #[test]
    fn the_fastest_episode_that_won_is_the_par_of_its_level() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("people.demo");
        let header = DemoHeader::new("garden", 1, "hard", 20.0, ActionSpace::Discrete(2));
        let mut writer = DemoWriter::replace(&path, header).expect("writable");
        let won = DemoEnd::Terminated { success: true };
        for (level, ticks, end) in [(7, 9, won), (7, 5, won), (7, 2, DemoEnd::Truncated), (8, 3, DemoEnd::Aborted)] {
            let episode = DemoEpisode {
                actions: Actions::Discrete(vec![1; ticks]),
                rewards: vec![0.0; ticks],
                state_hashes: vec![1; ticks],
                deciders: vec![Decider::Human; ticks],
                end,
                ..DemoEpisode::new(level, ActionSpace::Discrete(2))
            };
            writer.push(&episode).expect("writable");
        }
        drop(writer);
        let pars = Pars::read(folder.path(), &garden()).expect("recordings");
        assert_eq!((pars.of("hard:7"), pars.of("hard:8")), (Some(5.0), None));
    }
}
