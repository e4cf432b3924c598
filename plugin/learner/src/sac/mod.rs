//! Soft actor-critic (Haarnoja et al. 2018) for continuous and for discrete actions, with or without a skill decoder.
//!
//! Discrete actions take expectations over all choices instead of draws, and act by drawing from the policy; actor and
//! critics are networks of their own.

mod batch;
mod buffer;
mod buffer_file;
mod config;
mod critics;
mod demos;
mod explore;
mod learner;
mod loss;
mod metrics;
mod nets;
mod rlpd;
mod soft_update;
mod steps;
mod transitions;
mod update;

pub use batch::SacBatch;
pub use config::{EntropyCoef, SacConfig};
pub use critics::{Critics, QNet};
pub use learner::SacLearner;
pub use loss::{critic_loss, q_target, soft_value, soft_value_of_choices, temperature_loss};
pub use metrics::SacMetrics;
pub use nets::{LogTemperature, SacNets};
pub use rlpd::RlpdConfig;
pub use soft_update::soft_update;
pub use steps::{ActorStep, CriticStep, TemperatureStep, actor_step, critic_step, target_of, temperature_step};
pub(crate) use transitions::check_ends;
