//! Policies: networks that act, networks that estimate values, and the frozen snapshot of both.

mod actor;
mod critic;
mod inputs;
mod output;
mod shape;
mod snapshot;

pub use actor::{Actor, LogStd, StdKind};
pub use critic::Critic;
pub use inputs::NetInput;
pub(crate) use inputs::{InputBuilder, StateBatch, joined_rows};
pub use output::PolicyOutput;
pub use shape::NetShape;
pub(crate) use shape::{ActorShape, InputWidths, StdShape};
pub use snapshot::Policy;
#[cfg(test)]
pub(crate) use snapshot::VECTORS_AT_A_TIME;
