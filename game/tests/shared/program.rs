//! Starting of the program, and its output.

#![allow(dead_code, unused_imports, reason = "no test needs all of it")]

use std::{
    io::{Seek, Write},
    path::Path,
    process::{Command, Output},
};

pub use playbot_shell::{code, errors, json_lines, lines, said, unsealed};

pub fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_playbot"));
    command.args(args).current_dir(folder);
    command
}

pub fn playbot(folder: &Path, args: &[&str]) -> Output {
    playbot_shell::output(&mut command(folder, args)).unwrap_or_else(|error| panic!("{args:?}: {error}"))
}

/// Returns the output of a call with this text as its standard input.
pub fn piped(folder: &Path, args: &[&str], input: &str) -> Output {
    let mut file = tempfile::tempfile().expect("writable");
    file.write_all(input.as_bytes()).expect("writable");
    file.rewind().expect("a file");
    command(folder, args).stdin(file).output().expect("it starts")
}

/// Returns the program with a limit on the size of its files, in blocks of 512 bytes: a full disk.
#[cfg(unix)]
pub fn on_full_disk(folder: &Path, blocks: u32, args: &str) -> Output {
    let line = format!("trap '' XFSZ; ulimit -f {blocks}; exec {} {args}", env!("CARGO_BIN_EXE_playbot"));
    Command::new("sh").args(["-c", &line]).current_dir(folder).output().expect("a shell")
}

/// Returns the data and messages of a call that works.
pub fn done(folder: &Path, args: &[&str]) -> (String, String) {
    ended(folder, args, 0)
}

/// Returns the data and messages of a call that ends with this exit code.
pub fn ended(folder: &Path, args: &[&str], wanted: i32) -> (String, String) {
    playbot_shell::ended(command(folder, args), wanted)
}
