//! Programs that are disturbed at their work.

use std::{
    process::{Child, Command},
    time::Duration,
};

/// Starts a program, and waits until it is at work.
#[track_caller]
pub fn at_work(command: &mut Command, is_at_work: impl Fn() -> bool) -> Child {
    let mut child = command.spawn().expect("the program starts");
    while !is_at_work() {
        assert!(child.try_wait().expect("a child").is_none(), "{command:?} ended by itself");
        std::thread::park_timeout(Duration::from_millis(1));
    }
    child
}

/// SIGKILL, as a power cut would be: no handler runs, whatever was being written stays as it is.
pub fn kill(mut child: Child) {
    child.kill().expect("it runs");
    child.wait().expect("a child");
}
