//! Levels that are files: what games read, and what the program does with them.

mod assertions;
mod errors;
mod held_out;
#[path = "../shared/program.rs"]
mod program;
mod recordings;
mod round_trip;
mod verbs;
