//! `playbot report`.

mod calibrate;
mod failure;
mod html;
mod merge;
mod verb;

pub use verb::{Args, run};
