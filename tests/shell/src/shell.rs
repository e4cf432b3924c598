//! A program, started as by a shell.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use serde_json::Value;

use crate::output::{ended, json_lines};

/// A program, and a folder of its own in which it is started: empty at first, and gone with this.
pub struct Shell {
    program: &'static str,
    folder: tempfile::TempDir,
}

impl Shell {
    /// Returns a shell for the program at this path.
    pub fn new(program: &'static str) -> Self {
        Self { program, folder: tempfile::tempdir().expect("a folder") }
    }

    /// Returns the folder.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Returns a path in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder().join(name)
    }

    /// Returns the program with these arguments, without a display.
    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(self.program);
        command.args(args).current_dir(self.folder()).env_remove("DISPLAY").stdin(Stdio::null());
        command
    }

    /// Runs the program, which must end with exit code 0, and returns its standard output.
    #[track_caller]
    pub fn done(&self, args: &[&str]) -> String {
        ended(self.command(args), 0).0
    }

    /// Runs the program, which must end with exit code 0, and returns its lines of JSON.
    #[track_caller]
    pub fn answers(&self, args: &[&str]) -> Vec<Value> {
        json_lines(&self.done(args))
    }

    /// Runs the program, which must end with exit code 0, and returns its only line of JSON.
    #[track_caller]
    pub fn answer(&self, args: &[&str]) -> Value {
        let mut answers = self.answers(args);
        assert_eq!(answers.len(), 1, "{args:?}: {answers:?}");
        answers.remove(0)
    }

    /// Returns the contents of a file in the folder.
    #[track_caller]
    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("cannot read {name}: {error}"))
    }
}
