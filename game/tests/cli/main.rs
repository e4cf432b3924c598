//! Tests of the program through its command line.

mod calibrate;
mod detectors;
mod diagnose;
mod eval;
mod explore;
mod findings;
mod init;
mod levels;
mod merging;
mod models;
mod named_policies;
mod onnx;
mod over_builds;
mod paths;
mod planting;
#[path = "../shared/program.rs"]
mod program;
mod pull_request;
mod review;
#[cfg(unix)]
mod serve;
mod skills;
mod switches;
mod testing;
mod trace;
mod usage;
mod work;

// The adapter that `playbot init` writes names the game's crate.
extern crate self as my_game;
pub use init::{Player, Screen, plugin};
