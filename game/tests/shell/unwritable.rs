//! Tests of a standard output that cannot be written: lost data is an error, help included.

use std::{fs::OpenOptions, process::Output};

use crate::program::{code, command, errors};

/// Runs the program with a standard output that is a full disk.
fn with_full_output(args: &[&str]) -> Output {
    let folder = tempfile::tempdir().expect("a folder");
    let full = OpenOptions::new().write(true).open("/dev/full").expect("a disk that is always full");
    command(folder.path(), args).stdout(full).output().expect("the program starts")
}

#[test]
fn what_cannot_be_written_is_not_called_done() {
    for args in [
        &["--help"][..],
        &["-h"],
        &["--version"],
        &["help", "train"],
        &["train", "--help"],
        &["demo", "verify", "--help"],
        &["config", "show"],
        &["config", "presets"],
        &["level", "coinrun", "--json"],
    ] {
        let output = with_full_output(args);
        assert_eq!(code(&output), 2, "{args:?}: {}", errors(&output));
        assert!(errors(&output).contains("cannot write to standard output"), "{args:?}: {}", errors(&output));
    }
}
