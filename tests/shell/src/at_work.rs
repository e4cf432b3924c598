//! Programs that are disturbed at their work.

use std::process::{Child, Command};

use crate::waiting::{PATIENCE, comes, last_words};

/// Starts a program, and waits until it is at work.
#[track_caller]
pub fn at_work(command: &mut Command, is_at_work: impl Fn() -> bool) -> Child {
    let mut child = command.spawn().expect("the program starts");
    let mut has_ended = false;
    let is_in_time = comes(PATIENCE, || {
        let is_at_work = is_at_work();
        has_ended = !is_at_work && child.try_wait().expect("a child").is_some();
        is_at_work || has_ended
    });
    assert!(!has_ended, "{command:?} ended by itself: {}", last_words(child));
    assert!(is_in_time, "{command:?} is not at work after {PATIENCE:?}: {}", last_words(child));
    child
}

/// Sends SIGKILL, as in a power cut: no handler runs, and files being written stay as they are.
pub fn kill(mut child: Child) {
    child.kill().expect("it runs");
    child.wait().expect("a child");
}
