//! Soft actor-critic (Haarnoja et al. 2018) for continuous and for discrete actions, with or without a skill decoder.
//!
//! Discrete actions take expectations over all choices instead of draws, and act by drawing from the policy; actor and
//! critics are networks of their own.

mod batch;
mod buffer;
mod checkpoint;
mod config;
mod explore;
mod learner;
mod loss;
mod metrics;
mod nets;
mod target;
mod transitions;
mod update;

pub use batch::SacBatch;
pub use config::{EntropyCoef, SacConfig};
pub use learner::SacLearner;
pub use loss::{alpha_loss, critic_loss, q_target, soft_value, soft_value_of_choices};
pub use metrics::SacMetrics;
pub use nets::{Critics, LogAlpha, SacNets};
pub use target::soft_update;
pub use update::{ActorStep, AlphaStep, CriticStep, actor_step, alpha_step, critic_step, target_of};
