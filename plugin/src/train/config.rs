//! What an experiment is.

use std::path::PathBuf;

use playbot_learner::{PpoConfig, SacConfig, ScoreConfig, SkillConfig};
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use super::algorithm::Algorithm;
use super::checkpoint::CheckpointConfig;
pub use crate::vision::ObservationKind;
use crate::{
    split::LevelSplit,
    vision::{ImageOptions, Sight},
};

/// One experiment: game, levels, data, networks and tuning. Read from a RON file; what the file leaves out has these
/// defaults.
///
/// Networks belong to what they are part of: `ppo.hidden` and `ppo.activation` (or `sac.…`) are those of actor and
/// critic, `skills.hidden`, `skills.encoder_hidden`, `skills.gru_hidden` and `skills.gru_layers` those of the skill model. A
/// policy that starts as a copy of the decoder has the decoder's layers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Name of the game.
    pub game: String,
    /// What agents see of it.
    #[serde(default)]
    pub observation: ObservationKind,
    /// Size and form of the pictures, for agents that see some.
    #[serde(default)]
    pub image: ImageOptions,
    /// How the policy is made.
    #[serde(default = "score_ppo")]
    pub algorithm: Algorithm,
    /// Levels to train on.
    pub train: LevelSplit,
    /// Held-out levels to evaluate on; never trained on.
    pub test: LevelSplit,
    /// File or folder of demonstrations.
    pub demos: PathBuf,
    /// Learn skills from at most so many recorded steps: whole episodes, drawn evenly over the recordings. From all of
    /// them if none is named.
    #[serde(default)]
    pub demo_steps: Option<u64>,
    /// Seed of everything random.
    #[serde(default = "one")]
    pub seed: u64,
    /// Seeds of a study, which runs everything once with each; `seed` alone if there are none.
    #[serde(default)]
    pub seeds: Vec<u64>,
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
    /// The learner of score-ppo and ppo.
    #[serde(default)]
    pub ppo: PpoConfig,
    /// The learner of score-sac and sac.
    #[serde(default)]
    pub sac: SacConfig,
    /// The three steps of SCORE.
    #[serde(default)]
    pub score: ScoreConfig,
    /// Evaluation.
    #[serde(default)]
    pub eval: EvalConfig,
    /// When the state of the training is saved.
    #[serde(default)]
    pub checkpoints: CheckpointConfig,
    /// What a study measures.
    #[serde(default)]
    pub study: StudyConfig,
    /// What a study compares; empty in the experiment of a single run.
    #[serde(default)]
    pub variants: Vec<Variant>,
}

fn score_ppo() -> Algorithm {
    Algorithm::ScorePpo
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

/// What a study measures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StudyConfig {
    /// Success rate, over the last 100 training episodes, whose first step is looked for.
    pub threshold: f64,
}

impl Default for StudyConfig {
    fn default() -> Self {
        Self { threshold: 0.8 }
    }
}

/// One side of a comparison: the experiment with some of its values changed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// Its name in tables and folders: letters, digits, `-`, `_` and `.`.
    pub name: String,
    /// What it changes, as `key=value`, in the manner of `--set`.
    #[serde(default)]
    pub set: Vec<String>,
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
        why: String,
    },
    /// The learner refuses its settings.
    #[error("{0}")]
    Settings(String),
}

fn refuse(key: &'static str, value: impl ToString, why: impl Into<String>) -> Result<(), ExperimentError> {
    Err(ExperimentError::Value { key, value: value.to_string(), why: why.into() })
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
        if self.steps == 0 {
            return refuse("steps", 0, "train for at least one step");
        }
        if self.demo_steps == Some(0) {
            return refuse("demo_steps", 0, "skills are learned from at least one step; `None` takes all");
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
        if !(0.0..=1.0).contains(&self.study.threshold) {
            return refuse("study.threshold", self.study.threshold, "a success rate lies in 0..1");
        }
        let settings = |error: playbot_learner::LearnError| ExperimentError::Settings(error.to_string());
        self.image.check().map_err(|error| ExperimentError::Settings(format!("image: {error}")))?;
        self.skills.validate().map_err(settings)?;
        self.score.validate().map_err(settings)?;
        self.sac.validate().map_err(settings)?;
        self.ppo_config().validate().map_err(settings)?;
        self.check_batches()
    }

    fn check_batches(&self) -> Result<(), ExperimentError> {
        if self.arenas == 0 {
            return refuse("arenas", 0, "somebody has to play");
        }
        let (arenas, worlds) = (u64::from(self.arenas), u64::from(self.worlds));
        if worlds == 0 || !arenas.is_multiple_of(worlds) {
            let why = format!("must divide `arenas` = {arenas}; {} does", nearest_divisor(arenas, worlds));
            return refuse("worlds", worlds, why);
        }
        let (batch, minibatches) = (arenas * self.ppo.num_steps as u64, self.ppo.minibatches as u64);
        if !self.algorithm.is_sac() && !batch.is_multiple_of(minibatches) {
            let (steps, near) = (self.ppo.num_steps, nearest_divisor(batch, minibatches));
            let why = format!("must divide `arenas` × `ppo.num_steps` = {arenas} × {steps} = {batch}; {near} does");
            return refuse("ppo.minibatches", minibatches, why);
        }
        Ok(())
    }

    /// What agents see.
    pub fn sight(&self) -> Sight {
        Sight { kind: self.observation, image: self.image }
    }

    /// The experiment of a single run: without what only a study reads.
    pub fn without_study(&self) -> Self {
        Self { seeds: Vec::new(), variants: Vec::new(), ..self.clone() }
    }

    /// The settings of PPO as the learner gets them: a learning rate that falls does so over the whole training, unless
    /// the experiment says otherwise.
    pub fn ppo_config(&self) -> PpoConfig {
        let mut config = self.ppo.clone();
        if config.anneal_lr && self.steps_per_update() > 0 {
            config.total_updates = config.total_updates.or_else(|| Some(self.updates()));
        }
        config
    }

    /// Ticks of one rollout.
    pub fn rollout_steps(&self) -> usize {
        if self.algorithm.is_sac() { self.sac.num_steps } else { self.ppo.num_steps }
    }

    /// Environment steps of one rollout.
    pub fn steps_per_update(&self) -> u64 {
        u64::from(self.arenas) * self.rollout_steps() as u64
    }

    /// Rollouts, and so updates, of the whole training.
    pub fn updates(&self) -> u64 {
        self.steps.div_ceil(self.steps_per_update())
    }

    /// The experiment as RON, all defaults filled in.
    ///
    /// # Errors
    ///
    /// The path of the demonstrations is not Unicode.
    pub fn to_ron(&self) -> Result<String, ron::Error> {
        ron::ser::to_string_pretty(self, ron::ser::PrettyConfig::default())
    }
}

/// The divisor of `n` nearest to `wanted`, the larger one of two.
fn nearest_divisor(n: u64, wanted: u64) -> u64 {
    let distance = |divisor: &u64| (divisor.abs_diff(wanted), u64::MAX - divisor);
    let small = (1..).take_while(|d| d * d <= n).filter(|d| n.is_multiple_of(*d));
    small.flat_map(|d| [d, n / d]).min_by_key(distance).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_divisor_is_one() {
        assert_eq!(nearest_divisor(8192, 7), 8);
        assert_eq!(nearest_divisor(64, 3), 4, "2 and 4 are equally near");
        assert_eq!(nearest_divisor(60, 0), 1);
        assert_eq!(nearest_divisor(7, 1000), 7);
    }
}
