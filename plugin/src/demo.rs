//! Demonstrations: recording an agent's actions, and replaying them bit by bit.
//!
//! The modules, in reading order:
//!
//! - [`file`](mod@file): files of recorded episodes.
//! - [`recorder`]: the recorder of agents' episodes, under any control.
//! - [`replay`]: the replay of a recording, and detection of the first tick that differs.

pub mod file;
pub mod recorder;
pub mod replay;
