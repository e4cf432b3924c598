//! Networks that act and networks that judge, and the snapshot of both that plays.

mod actor;
mod critic;
mod file;
mod join;
mod output;
mod shape;
mod snapshot;

pub use actor::{Actor, LogStd, NetShape, StdKind};
pub use critic::Critic;
pub use file::{PictureCard, PolicyCard, PolicyFile, SkillSource};
pub use join::NetInput;
pub(crate) use join::{HostStates, joined_rows};
pub use output::PolicyOutput;
pub use snapshot::Policy;
#[cfg(test)]
pub(crate) use snapshot::VECTORS_AT_A_TIME;
