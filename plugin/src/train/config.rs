//! What an experiment is.

use std::{fmt, path::PathBuf, str::FromStr};

use playbot_learner::{PpoConfig, ScoreConfig, SkillConfig};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::checkpoint::CheckpointConfig;
use crate::{game::UnknownName, split::LevelSplit};

/// One experiment: game, levels, data, networks and tuning. Read from a RON file; what the file leaves out has these
/// defaults.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Name of the game.
    pub game: String,
    /// Levels to train on.
    pub train: LevelSplit,
    /// Held-out levels to evaluate on; never trained on.
    pub test: LevelSplit,
    /// File or folder of demonstrations.
    pub demos: PathBuf,
    /// Seed of everything random.
    #[serde(default = "one")]
    pub seed: u64,
    /// Environment steps to train for, over all arenas together; rounded up to whole rollouts.
    pub steps: u64,
    /// Arenas that play at the same time.
    #[serde(default = "default_arenas")]
    pub arenas: u32,
    /// Worlds the arenas are spread over; the number of threads that can simulate at the same time. Part of the
    /// experiment, since the rows of a batch are computed together; the number of threads is not.
    #[serde(default = "default_worlds")]
    pub worlds: u32,
    /// The skill model.
    #[serde(default)]
    pub skills: SkillConfig,
    /// The learner.
    #[serde(default)]
    pub ppo: PpoConfig,
    /// The three steps of SCORE.
    #[serde(default)]
    pub score: ScoreConfig,
    /// Evaluation.
    #[serde(default)]
    pub eval: EvalConfig,
    /// When the state of the training is saved.
    #[serde(default)]
    pub checkpoints: CheckpointConfig,
}

fn one() -> u64 {
    1
}

fn default_arenas() -> u32 {
    64
}

fn default_worlds() -> u32 {
    2
}

/// How policies are measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EvalConfig {
    /// Episodes on each level; every level is played equally often.
    pub episodes_per_level: u32,
    /// Take the most probable action instead of drawing one.
    pub greedy: bool,
}

impl Default for EvalConfig {
    fn default() -> Self {
        Self { episodes_per_level: 4, greedy: false }
    }
}

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
    /// A number is out of range.
    #[error("`{key}` is {value}: {why}")]
    Value {
        /// Key in the file.
        key: &'static str,
        /// Its value.
        value: String,
        /// What it must be.
        why: &'static str,
    },
}

impl Experiment {
    /// Checks what single values cannot say.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the key to change.
    pub fn check(&self) -> Result<(), ExperimentError> {
        if self.train.overlaps(&self.test) {
            return Err(ExperimentError::Overlap { train: self.train.clone(), test: self.test.clone() });
        }
        let refuse = |key, value: u64, why| Err(ExperimentError::Value { key, value: value.to_string(), why });
        if self.worlds == 0 || !self.arenas.is_multiple_of(self.worlds) || self.arenas == 0 {
            return refuse("worlds", self.worlds.into(), "must divide `arenas`, and neither may be 0");
        }
        if self.steps == 0 {
            return refuse("steps", 0, "train for at least one step");
        }
        if self.score.horizon == 0 {
            return refuse("score.horizon", 0, "a skill is held for at least one tick");
        }
        if self.eval.episodes_per_level == 0 {
            return refuse("eval.episodes_per_level", 0, "a verdict needs at least one episode");
        }
        if self.checkpoints.every == 0 {
            return refuse("checkpoints.every", 0, "is a number of updates, at least one");
        }
        if self.checkpoints.keep == 0 {
            return refuse("checkpoints.keep", 0, "at least the latest checkpoint must stay");
        }
        let batch = u64::from(self.arenas) * self.ppo.num_steps as u64;
        if self.ppo.minibatches == 0 || !batch.is_multiple_of(self.ppo.minibatches as u64) {
            return refuse("ppo.minibatches", self.ppo.minibatches as u64, "must divide arenas × ppo.num_steps");
        }
        Ok(())
    }

    /// Environment steps of one rollout.
    pub fn steps_per_update(&self) -> u64 {
        u64::from(self.arenas) * self.ppo.num_steps as u64
    }

    /// Rollouts, and so updates, of the whole training.
    pub fn updates(&self) -> u64 {
        self.steps.div_ceil(self.steps_per_update())
    }
}

/// Learners that can be trained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Algorithm {
    /// PPO with skills: the paper's method.
    ScorePpo,
    /// PPO without skills: the same network, steps and tuning.
    Ppo,
}

impl Algorithm {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::ScorePpo, Self::Ppo];

    /// Name on the command line and in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::ScorePpo => "score-ppo",
            Self::Ppo => "ppo",
        }
    }

    /// Whether a skill model is needed.
    pub fn needs_skills(self) -> bool {
        self == Self::ScorePpo
    }
}

impl fmt::Display for Algorithm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Algorithm {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let names = Self::ALL.map(Self::name);
        Self::ALL
            .into_iter()
            .find(|algorithm| algorithm.name() == name)
            .ok_or_else(|| UnknownName::new("algorithm", name, &names))
    }
}
