//! Proximal policy optimisation (Schulman et al. 2017), with or without a skill decoder.

mod batch;
mod checkpoint;
mod config;
mod gae;
mod learner;
mod loss;
mod metrics;
mod nets;
mod update;

pub use batch::Minibatch;
pub use config::PpoConfig;
pub use gae::{Advantages, gae};
pub use learner::PpoLearner;
pub use loss::{PpoBatch, PpoLoss, normalize_advantages, ppo_loss};
pub use metrics::{RatioStats, UpdateMetrics, explained_variance, ratio_stats};
pub use nets::PpoNets;
pub use update::{StepMetrics, gradient_step};
