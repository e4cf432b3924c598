//! The teacher: the frozen decoder and prior of a skill model.

mod batch;
mod checkpoint;
mod frozen;
mod initial_kl;

pub use batch::TeacherBatch;
pub(crate) use batch::TeacherOutput;
pub(crate) use frozen::{Teacher, TiedTo};
