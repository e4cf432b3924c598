//! The documentation is true: its Rust is compiled, its commands can be called, its experiments can be read, and what it
//! points to is there.

mod blocks;
mod commands;
mod experiments;
mod level_files;
mod links;
#[allow(dead_code, reason = "its `main` is what a reader of the tutorial starts")]
mod runner;
mod sources;
mod tutorial;
