//! Learning from demonstrations and from reward, over burn; knows nothing of any game engine.
//!
//! # Concepts
//!
//! - A [`SkillModel`] is learned from [`DatasetEpisode`]s by a [`SkillTrainer`]. Its encoder describes several steps of
//!   a demonstrator by a latent skill z. Its decoder π(a | s, z) repeats them. Its [`Prior`] p(z | s) says which
//!   skills fit a state.
//! - A [`Policy`] is a frozen snapshot that plays: [`Policy::forward`] returns action distributions and values for a
//!   batch of observations. The decoder under the prior is such a policy ([`SkillModel::policy`]): behaviour cloning.
//! - A [`PpoLearner`] improves a policy from [`Rollout`]s by PPO. With a skill model it is SCORE-PPO. The policy reads
//!   the skill z, starts as a copy of the decoder, and is penalised for leaving it where the decoder is confident
//!   ([`ScoreConfig`]).
//! - A [`SacLearner`] does so by SAC, from the same rollouts and with the same ties to a skill model. It keeps
//!   transitions and learns from them repeatedly.
//! - A [`SpirlLearner`] learns, by either algorithm, which skills the decoder plays, instead of drawing them from the
//!   prior.
//! - Training code is independent of the algorithm: all implement [`Learner`].
//!
//! Observations are vectors or images ([`ObsKind`]); SAC alone reads only vectors. Vectors may hold sets of things
//! ([`EntitySet`]). Rows are flat `f32` slices in host
//! memory (bytes for pixels), row-major ([`ObsSlice`]). All randomness comes from generators that the caller owns or
//! from the named [`rng::Streams`] of one seed. The same seed gives the same numbers, whatever the number of threads.
//!
//! # Example
//!
//! ```
//! use playbot_learner::rng::Streams;
//! use playbot_learner::{ActionSpace, DeviceKind, Learner, PolicySpec, PpoConfig, PpoLearner};
//!
//! let spec = PolicySpec { obs: 2.into(), latent: 0, action_space: ActionSpace::Discrete(3) };
//! let learner = PpoLearner::new(PpoConfig::default(), spec, 1, DeviceKind::Flex)?;
//! let policy = learner.policy();
//! let output = policy.forward(&[], &[0.1, 0.2, 0.3, 0.4], 2)?;
//! let mut rng = Streams::new(1).stream("actions", 0);
//! let (action, log_prob) = output.sample(0, &mut rng);
//! assert!(log_prob <= 0.0, "{action:?} has a probability");
//! # Ok::<(), playbot_learner::LearnError>(())
//! ```

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the system's functions"))]

mod begin_from;
mod device;
pub mod disk;
mod entities;
mod error;
mod file;
mod learner;
pub mod legacy;
mod legal;
mod mixed_space;
pub mod nn;
pub mod norm;
mod observation;
pub mod policy;
mod policy_file;
pub mod ppo;
pub mod rng;
mod rollout;
pub mod sac;
pub mod score;
mod seen_levels;
pub mod settings;
pub mod skill;
mod space;
pub mod spirl;

pub use crate::{
    begin_from::{InputMap, StartFrom, TakenOver},
    device::{DeviceKind, Traffic, UnknownDevice},
    disk::{write_atomically, write_atomically_with},
    entities::{EntityBlock, EntitySet, PRESENT},
    error::{FileError, HasExitCode, LearnError, SettingError, brief_number, io_exit_code},
    file::{BrokenSeal, Unsealed, seal_json, seal_text, unseal_json, unseal_text},
    learner::{ContinuedSchedule, LearnTimes, Learner, LearnerBase, LearnerMetrics},
    mixed_space::{Choices, MOST_CHOICES, MixedSpace},
    norm::RewardReset,
    observation::{Augmentation, ImageShape, ObsKind, ObsSlice, Observations, PictureMetadata},
    policy::{EntityKind, MemoryKind, Policy, PolicyOutput, StdKind},
    policy_file::{PolicyFile, PolicyMetadata},
    ppo::{Curiosity, ImitationConfig, LabelledSteps, PpoConfig, PpoLearner, UpdateMetrics},
    rng::{RngState, Streams},
    rollout::{EndStates, ObsColumns, Rollout, RolloutStep},
    sac::{EntropyCoef, RlpdConfig, SacConfig, SacLearner, SacMetrics},
    score::{ConfidenceKind, KlDirection, PenaltyForm, PriorKind, ScoreConfig},
    seen_levels::SeenLevels,
    skill::{
        ActionInput, Dataset, DatasetEpisode, Prior, Reduction, SkillConfig, SkillDraw, SkillMetrics, SkillModel,
        SkillProgress, SkillSource, SkillTrainer, WindowRule,
    },
    space::{ActionSpace, ActionValue, Actions, PolicySpec, TimeLimit},
    spirl::{SpirlConfig, SpirlLearner},
};
pub use playbot_kernels::{
    among_workers::{Workers, among_awake_workers, among_workers, shared_time, waited},
    instructions::{Instructions, limit_by_environment},
};

/// Compiles and runs the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
