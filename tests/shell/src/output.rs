//! Output of a program, and its end.

use std::process::{Command, Output};

use serde_json::Value;

use crate::waiting;

/// Its exit code.
#[track_caller]
pub fn code(output: &Output) -> i32 {
    output.status.code().expect("not killed")
}

/// Its messages to people.
pub fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Its data.
pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Its data, where every line is JSON.
#[track_caller]
pub fn lines(output: &Output) -> Vec<Value> {
    json_lines(&said(output))
}

/// Returns a text of which every line is JSON.
#[track_caller]
pub fn json_lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|_| panic!("no JSON: {line}"))).collect()
}

/// Runs a program, which must end with this exit code, and in three minutes, and returns its data and messages.
#[track_caller]
pub fn ended(command: Command, wanted: i32) -> (String, String) {
    let (_, out, err) = ended_in(command, &[wanted]);
    (out, err)
}

/// Runs a program, which must end with one of these exit codes, and in three minutes, and returns its code, its data and
/// its messages.
#[track_caller]
pub fn ended_in(mut command: Command, wanted: &[i32]) -> (i32, String, String) {
    let output = match waiting::output(&mut command) {
        Ok(output) => output,
        Err(error) => panic!("{command:?}: {error}"),
    };
    let (code, out, err) = (code(&output), said(&output), errors(&output));
    assert!(wanted.contains(&code), "{command:?} ended with {code}, and not with {wanted:?}: {out}{err}");
    (code, out, err)
}
