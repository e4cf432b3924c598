//! The program as its users call it.

mod eval;
#[path = "../shared/program.rs"]
mod program;
mod switches;
mod trace;
mod usage;
mod work;
