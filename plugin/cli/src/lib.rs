//! The command line: one file per verb. Data goes to standard output, everything else to standard error.
#![allow(clippy::print_stdout, reason = "a command line prints")]

#[macro_use]
mod tell;

mod bench;
mod bugs;
mod cloning;
mod command_line;
mod compute;
mod config;
mod console;
mod defaults;
mod demo;
mod demo_merge;
mod demo_show;
mod differences;
mod doctor;
mod error;
mod eval;
mod experiment;
mod explore;
mod eyes;
mod footprints;
mod help;
mod interrupt;
mod learn_skills;
mod level;
mod level_picture;
mod log;
#[cfg(all(target_os = "linux", feature = "camera"))]
mod mesa;
mod methods;
mod named;
mod number;
mod one_level;
mod open;
mod output;
mod pace;
mod play;
mod player;
mod plot;
mod policy;
mod program;
mod progress;
mod quickstart;
mod record;
mod recording;
mod replay;
mod report;
mod runs;
mod study;
mod test;
mod trace;
mod train;
mod unread_settings;
mod unseen;
mod unwritten;
mod usage_error;
mod view;
#[cfg(feature = "window")]
pub mod window;
mod words;

pub use command_line::{check_usage, main};

/// Compiles the code blocks of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
