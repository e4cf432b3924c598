//! `playbot report`.

mod merge;
mod verb;

pub use verb::{Args, run};
