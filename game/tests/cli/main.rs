//! The program as its users call it.

mod eval;
mod program;
mod switches;
mod trace;
mod usage;
mod work;
