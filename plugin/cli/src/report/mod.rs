//! `playbot report`.

mod html;
mod merge;
mod verb;

pub use verb::{Args, run};
