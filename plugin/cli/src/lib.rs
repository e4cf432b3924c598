//! The command line: one file per verb. Data goes to standard output, everything else to standard error.

#![allow(clippy::print_stdout, reason = "a command line prints")]

#[macro_use]
mod tell;
mod arguments;
mod command_line;
mod console;
mod error;
mod help;
mod interrupt;
mod log;
#[cfg(all(target_os = "linux", feature = "camera"))]
mod mesa;
mod output;
pub mod pictures;
mod plot;
mod progress;
mod verbs;
#[cfg(feature = "window")]
pub mod window;

pub use crate::command_line::{check_usage, main};

/// Compiles the code blocks of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub mod prelude;

pub use playbot_harness as harness;
pub use playbot_learner as learner;
pub use playbot_mutation as mutation;
pub use playbot_report as report;
pub use playbot_test as test;
pub use playbot_train as train;

pub use playbot_harness::{foreign::ForeignGame, game::Game};
pub use playbot_test::assertions::{
    LevelTest, assert_deterministic, assert_findings_gone, assert_levels_solvable, assert_levels_solved_by,
    assert_no_findings, assert_replays,
};
