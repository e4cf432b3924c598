//! Starting the program, and reading what it says.

use std::{
    path::Path,
    process::{Command, Output},
};

use serde_json::Value;

pub fn playbot(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_playbot")).args(args).current_dir(folder).output().expect("the program starts")
}

pub fn code(output: &Output) -> i32 {
    output.status.code().expect("not killed")
}

pub fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

pub fn lines(output: &Output) -> Vec<Value> {
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect()
}
