//! Proximal policy optimisation (Schulman et al. 2017), with or without a skill decoder.

mod augmented;
mod batch;
mod config;
mod host_loss;
mod learner;
mod metrics;
mod nets;
mod objective;
mod on_device;
mod step;
mod update;

pub use config::PpoConfig;
pub use learner::PpoLearner;
pub use metrics::{RatioStats, StepMetrics, UpdateMetrics, explained_variance, ratio_stats};
pub use nets::PpoNets;
pub use objective::{Advantages, PpoBatch, PpoLoss, gae, normalize_advantages, ppo_loss};
pub use step::{Minibatch, gradient_step};
