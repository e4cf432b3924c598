//! Demonstrations: recording what an agent does, checking recordings by replay, and reading them back for learning.

pub mod dataset;
pub mod file;
mod onlooker;
pub mod recorder;
pub mod replay;
pub mod verify;
