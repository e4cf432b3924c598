//! What all learners have in common: the trait by which they are trained, and the frame that they are built on.

mod base;
mod checkpoint;
mod learner_trait;

pub use base::LearnerBase;
pub(crate) use checkpoint::Checkpoint;
pub use learner_trait::{Learner, LearnerMetrics};
