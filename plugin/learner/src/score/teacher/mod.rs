//! The teacher: the decoder and the prior of a skill model, which do not learn any more.

mod batch;
mod checkpoint;
mod frozen;
mod initial_kl;

pub use batch::TeacherBatch;
pub(crate) use batch::TeacherOutput;
pub(crate) use frozen::{Teacher, TiedTo};
