//! The program as its users call it.

mod detectors;
mod eval;
mod explore;
mod findings;
mod paths;
#[path = "../shared/program.rs"]
mod program;
mod switches;
mod testing;
mod trace;
mod usage;
mod work;
