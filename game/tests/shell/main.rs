//! What the program says to a shell: exit codes, and words about what cannot be done or was not done.

mod recordings;
#[cfg(unix)]
mod stopped;
mod written;

use std::{
    path::Path,
    process::{Command, Output},
};

use serde_json::Value;

fn playbot(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_playbot")).args(args).current_dir(folder).output().expect("the program starts")
}

/// The program with a limit on the size of its files, in blocks of 512 bytes: a full disk.
#[cfg(unix)]
fn on_full_disk(folder: &Path, blocks: u32, args: &str) -> Output {
    let line = format!("trap '' XFSZ; ulimit -f {blocks}; exec {} {args}", env!("CARGO_BIN_EXE_playbot"));
    Command::new("sh").args(["-c", &line]).current_dir(folder).output().expect("a shell")
}

fn code(output: &Output) -> Option<i32> {
    output.status.code()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn lines(output: &Output) -> Vec<Value> {
    said(output).lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect()
}
