//! `playbot report`.

mod calibrate;
mod html;
mod merge;
mod verb;

pub use verb::{Args, run};
