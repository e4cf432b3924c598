//! Tests of Ctrl-C while an episode is played for a picture.

use std::{
    fs,
    path::Path,
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::program::{code, command, errors};

/// Returns true if a process handles Ctrl-C, which is signal 2.
fn listens(child: &Child) -> bool {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    let caught = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    caught.is_some_and(|mask| mask & 0b10 != 0)
}

/// Plays an episode that takes minutes, and presses Ctrl-C shortly after it has begun.
fn stopped(folder: &Path, more: &[&str], moment: Duration) -> Output {
    let endless = ["view", "maze2d", "--mode", "medium+limit=100000000", "--bot", "random"];
    let mut begun = command(folder, &[&endless[..], more].concat());
    let mut child = begun.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program starts");
    while !listens(&child) {
        assert!(child.try_wait().expect("a child").is_none(), "it ended by itself");
        thread::park_timeout(Duration::from_millis(1));
    }
    let start = Instant::now();
    while let Some(left) = moment.checked_sub(start.elapsed()) {
        thread::park_timeout(left);
    }
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("a shell's kill");
    assert!(sent.success(), "it ended by itself");
    child.wait_with_output().expect("a child")
}

#[test]
fn a_stopped_view_is_not_done() {
    let folder = tempfile::tempdir().expect("a folder");
    let film = ["--episode", "--image", "width=8", "--image", "height=8", "--scale", "1"];
    let still = ["--tick", "90000000"];
    for (args, millis) in [(&film[..], 0), (&film[..], 400), (&still[..], 100)] {
        let output = stopped(folder.path(), args, Duration::from_millis(millis));
        let words = errors(&output);
        assert_eq!(code(&output), 130, "{args:?}: {words}");
        assert!(words.contains("stopping after this step") && !words.contains("there is no tick"), "{args:?}: {words}");
    }
}
