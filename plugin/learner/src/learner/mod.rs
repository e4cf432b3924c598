//! The common interface and frame of all learners.

mod base;
mod checkpoint;
mod learner_trait;

pub use base::LearnerBase;
pub(crate) use checkpoint::Checkpoint;
pub use learner_trait::{Learner, LearnerMetrics};
