//! What an experiment is.

use std::path::PathBuf;

use playbot_learner::{PpoConfig, RlpdConfig, SacConfig, ScoreConfig, SkillConfig, SpirlConfig};
use serde::{Deserialize, Serialize, Serializer};

use super::checkpoint::CheckpointConfig;
pub use super::{
    algorithm::{Algorithm, LearnerKind},
    experiment_error::ExperimentError,
};
use crate::split::LevelSplit;
pub use bevy_playbot::vision::ObservationKind;
use bevy_playbot::vision::{ImageOptions, ObservationConfig};

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
    /// File or folder of demonstrations; `None` for algorithms that learn nothing from any.
    #[serde(default, serialize_with = "plain")]
    pub demos: Option<PathBuf>,
    /// Learn from at most so many recorded steps: whole episodes, drawn evenly over the recordings. From all of
    /// them if none is named.
    #[serde(default)]
    pub demo_steps: Option<u64>,
    /// Learn only from recorded episodes that ended at the goal: of demonstrators that do not always get there. Episodes of
    /// games that go on at the goal end nowhere, and are left out.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub demo_wins: bool,
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
    /// The learner of score-ppo, ppo and spirl-ppo.
    #[serde(default)]
    pub ppo: PpoConfig,
    /// The learner of score-sac, sac, spirl-sac and rlpd.
    #[serde(default)]
    pub sac: SacConfig,
    /// The three steps of SCORE.
    #[serde(default)]
    pub score: ScoreConfig,
    /// What spirl-ppo and spirl-sac add to that.
    #[serde(default)]
    pub spirl: SpirlConfig,
    /// What rlpd adds to `sac`.
    #[serde(default)]
    pub rlpd: RlpdConfig,
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

/// A path as text, as files have it, and not as `Some(text)`.
fn plain<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> Result<S::Ok, S::Error> {
    match path {
        Some(path) => path.serialize(serializer),
        None => serializer.serialize_none(),
    }
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
    /// Episodes on each level; every level is played equally often. More levels tell more than more episodes on the same
    /// ones.
    pub episodes_per_level: u32,
    /// Take the most probable action instead of drawing one.
    pub greedy: bool,
}

impl Default for EvalConfig {
    fn default() -> Self {
        Self { episodes_per_level: 1, greedy: false }
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

impl Experiment {
    /// What agents see.
    pub fn observation_config(&self) -> ObservationConfig {
        ObservationConfig { kind: self.observation, image: self.image }
    }

    /// The experiment of a single run: without what only a study reads.
    pub fn without_study(&self) -> Self {
        Self { seeds: Vec::new(), variants: Vec::new(), ..self.clone() }
    }

    /// The settings of PPO as the learner gets them: a learning rate that falls does so over the whole training, unless
    /// the experiment says otherwise.
    pub fn ppo_config(&self) -> PpoConfig {
        let mut config = self.ppo.clone();
        let changes = config.anneal_lr || self.score.kl_coef_end.is_some();
        if changes && self.steps_per_update() > 0 {
            config.total_updates = config.total_updates.or_else(|| Some(self.updates()));
        }
        config
    }

    /// Ticks of one rollout.
    pub fn rollout_steps(&self) -> usize {
        match self.algorithm.learner() {
            LearnerKind::Ppo => self.ppo.num_steps,
            LearnerKind::Sac => self.sac.num_steps,
        }
    }

    /// Environment steps of one rollout.
    pub fn steps_per_update(&self) -> u64 {
        u64::from(self.arenas).saturating_mul(self.rollout_steps() as u64)
    }

    /// Rollouts, and so updates, of the whole training.
    pub fn updates(&self) -> u64 {
        self.steps.div_ceil(self.steps_per_update())
    }

    /// Environment steps that are trained: [`steps`](Self::steps), rounded up to whole rollouts.
    pub fn whole_steps(&self) -> u64 {
        // A rollout of no steps is no experiment that can be run, and no reason to fail here.
        self.steps.checked_next_multiple_of(self.steps_per_update()).unwrap_or(self.steps)
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
