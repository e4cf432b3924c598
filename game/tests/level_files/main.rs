//! Tests of levels that are files, in games and in the program.

mod assertions;
mod errors;
mod held_out;
#[path = "../shared/program.rs"]
mod program;
mod recordings;
mod round_trip;
mod verbs;
