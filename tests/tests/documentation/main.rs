//! Tests of the documentation: its Rust is compiled, its commands can be called, its experiments can be read, and its
//! links lead to files.

mod blocks;
mod commands;
mod experiments;
#[allow(dead_code, reason = "its `main` is what a reader of the tutorial starts")]
mod hand_made;
mod level_files;
mod links;
#[allow(dead_code, reason = "its `main` is what a reader of the tutorial starts")]
mod runner;
mod settings;
mod sources;
mod tutorial;
