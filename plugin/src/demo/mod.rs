//! Demonstrations: recording what an agent does, and replaying it to the bit.

pub mod file;
pub mod recorder;
pub mod replay;
