//! What can be wrong with an experiment.

use playbot_learner::LearnError;
use thiserror::Error;

use super::config_keys::Keys;
use crate::{mode::ModeError, split::LevelSplit};

/// The experiment makes no sense.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum ExperimentError {
    /// Training and held-out levels share a level.
    #[error("training levels {train} and held-out levels {test} overlap: choose ranges that share no level")]
    Overlap {
        /// Training levels.
        train: LevelSplit,
        /// Held-out levels.
        test: LevelSplit,
    },
    /// A training level shows what a held-out level shows.
    #[error(
        "level {level} of the training levels {train} is, or looks like, one of the held-out levels {test}: choose others"
    )]
    Leak {
        /// Training levels.
        train: Box<LevelSplit>,
        /// The first of them that gives something away.
        level: u64,
        /// Held-out levels.
        test: Box<LevelSplit>,
    },
    /// The game has no such mode.
    #[error("`{key}` is {levels}: {source}; name levels of this game, as in `--set {key}={example}:0..63`")]
    Mode {
        /// Key in the file.
        key: &'static str,
        /// Its value.
        levels: Box<LevelSplit>,
        /// What is wrong with the mode.
        source: Box<ModeError>,
        /// A mode that the game has.
        example: &'static str,
    },
    /// What a training keeps is more than the machine has room for.
    #[error("{what} need {}, and {} of memory are free: lower {keys}", amount(*needed), amount(*free))]
    Memory {
        /// What it is, with the factors.
        what: String,
        /// Bytes that it takes.
        needed: u64,
        /// Bytes that are free.
        free: u64,
        /// What to lower.
        keys: String,
    },
    /// A number is out of range.
    #[error("`{key}` is {value}: {why}")]
    Value {
        /// Key in the file.
        key: &'static str,
        /// Its value.
        value: String,
        /// What it must be.
        why: String,
    },
    /// There is nothing to learn from.
    #[error("`demos` is missing: there is something to learn from recordings, so name a file or a folder of them")]
    NoDemos,
    /// The learner refuses its settings.
    #[error("{words}")]
    Settings {
        /// Key or section in the file, if one is to blame.
        key: Option<String>,
        /// What is wrong.
        words: String,
    },
}

impl ExperimentError {
    /// The keys or sections to look at, the first one first.
    pub fn keys(&self) -> Vec<&str> {
        match self {
            Self::Overlap { .. } | Self::Leak { .. } => vec!["train", "test"],
            Self::Mode { key, .. } | Self::Value { key, .. } => vec![key],
            // Keys are named between backticks.
            Self::Memory { keys, .. } => keys.split('`').skip(1).step_by(2).collect(),
            Self::NoDemos => vec!["algorithm"],
            Self::Settings { key, .. } => key.as_deref().into_iter().collect(),
        }
    }
}

/// Bytes in the unit that makes a number of them that can be read.
fn amount(bytes: u64) -> String {
    let (unit, name) = if bytes < 1 << 30 { (1 << 20, "MiB") } else { (1 << 30, "GiB") };
    format!("{:.1} {name}", bytes as f64 / f64::from(unit))
}

/// What a learner has against its settings; that they are settings goes without saying. It begins with the name of one,
/// as `ppo lr`, which is `ppo.lr` in the file.
pub(super) fn settings(error: LearnError) -> ExperimentError {
    let words = match error {
        LearnError::Config(text) => text,
        other => other.to_string(),
    };
    let mut parts = words.splitn(3, ' ');
    let section = parts.next().map(|section| if section == "skill" { "skills" } else { section });
    let name = parts.next().map(|name| name.trim_end_matches(':'));
    match section.zip(name).map(|(section, name)| format!("{section}.{name}")) {
        Some(key) if Keys::all().text(&key).is_some() => {
            let rest = parts.next().unwrap_or_default();
            ExperimentError::Settings { words: format!("`{key}` {rest}"), key: Some(key) }
        }
        _ => ExperimentError::Settings { key: None, words },
    }
}

pub(super) fn refuse(key: &'static str, value: impl ToString, why: impl Into<String>) -> Result<(), ExperimentError> {
    Err(ExperimentError::Value { key, value: value.to_string(), why: why.into() })
}
