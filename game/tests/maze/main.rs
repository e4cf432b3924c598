//! Tests of mazes: the fixed maps against golden data, the generator's promises, and the planner on both.

mod cli;
mod fixed;
mod generator;
#[path = "../shared/golden.rs"]
mod golden;
mod planner;
#[path = "../shared/program.rs"]
mod program;
