//! Demonstrations: recording an agent's actions, and replaying them bit by bit.

pub mod file;
pub mod recorder;
pub mod replay;
