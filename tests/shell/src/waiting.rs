//! Waiting for programs, with a limit.

use std::{
    io::{self, ErrorKind, Read},
    process::{Child, Command, Output, Stdio},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

/// Longest wait, also on a slow machine that draws in software.
pub(crate) const PATIENCE: Duration = Duration::from_secs(180);
/// Longest wait for the last output of a program that has ended.
const LAST_WORDS: Duration = Duration::from_secs(5);

/// Runs a program to its end, without input, and returns its output.
///
/// # Errors
///
/// It does not start, or does not end in three minutes: then it is killed with all its child processes, and the error
/// has its output until then.
pub fn output(command: &mut Command) -> io::Result<Output> {
    output_within(PATIENCE, command)
}

fn output_within(limit: Duration, command: &mut Command) -> io::Result<Output> {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    lead_group(command);
    let mut child = command.spawn()?;
    let stdout = Heard::of(child.stdout.take().expect("piped"));
    let stderr = Heard::of(child.stderr.take().expect("piped"));
    let is_over = comes(limit, || stdout.is_over() && stderr.is_over() && matches!(child.try_wait(), Ok(Some(_))));
    if is_over {
        let status = child.wait()?;
        return Ok(Output { status, stdout: stdout.bytes(), stderr: stderr.bytes() });
    }
    kill_group(&mut child);
    let words = format!("it does not end in {limit:?}, and said so far: {}{}", stdout.text(), stderr.text());
    Err(io::Error::new(ErrorKind::TimedOut, words))
}

/// Waits until a condition holds, and returns whether it did in time.
pub(crate) fn comes(limit: Duration, mut is_so: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    while !is_so() {
        if start.elapsed() >= limit {
            return false;
        }
        thread::park_timeout(Duration::from_millis(1));
    }
    true
}

/// Makes the program the head of a group of its child processes.
fn lead_group(command: &mut Command) {
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(command, 0);
    #[cfg(not(unix))]
    let _ = command;
}

/// Kills a program that leads its group, with its child processes.
fn kill_group(child: &mut Child) {
    if cfg!(unix) {
        let group = format!("-{}", child.id());
        let _ = Command::new("kill").args(["-KILL", "--", &group]).stderr(Stdio::null()).status();
    }
    kill_alone(child);
}

fn kill_alone(child: &mut Child) {
    // An error means that it has ended.
    let _ = child.kill();
    let _ = child.wait();
}

/// Kills a program, unless it has ended, and returns the contents of its pipes, if it has any.
pub(crate) fn last_words(mut child: Child) -> String {
    let pipes = [child.stdout.take().map(Heard::of), child.stderr.take().map(Heard::of)];
    kill_alone(&mut child);
    pipes.iter().flatten().map(Heard::to_end).collect()
}

/// The output of a program into a pipe so far. It is read all the time: a program with a full pipe would wait.
pub(crate) struct Heard {
    bytes: Arc<Mutex<Vec<u8>>>,
    reader: JoinHandle<()>,
}

impl Heard {
    /// Begins to read.
    pub(crate) fn of(mut pipe: impl Read + Send + 'static) -> Self {
        let bytes = Arc::new(Mutex::new(Vec::new()));
        let heard = bytes.clone();
        let reader = thread::spawn(move || {
            let mut part = [0; 4096];
            loop {
                match pipe.read(&mut part) {
                    Ok(0) => return,
                    Ok(count) => lock(&heard).extend_from_slice(&part[..count]),
                    Err(error) if error.kind() == ErrorKind::Interrupted => {}
                    Err(_) => return,
                }
            }
        });
        Self { bytes, reader }
    }

    /// Returns true if the pipe is closed.
    pub(crate) fn is_over(&self) -> bool {
        self.reader.is_finished()
    }

    fn bytes(&self) -> Vec<u8> {
        lock(&self.bytes).clone()
    }

    /// Returns the output so far.
    pub(crate) fn text(&self) -> String {
        String::from_utf8_lossy(&lock(&self.bytes)).into_owned()
    }

    /// Returns the whole output of a program that has ended.
    pub(crate) fn to_end(&self) -> String {
        comes(LAST_WORDS, || self.is_over());
        self.text()
    }
}

fn lock(bytes: &Mutex<Vec<u8>>) -> MutexGuard<'_, Vec<u8>> {
    bytes.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn shell(line: &str) -> Command {
        let mut shell = Command::new("sh");
        shell.args(["-c", line]);
        shell
    }

    #[test]
    fn a_program_that_ends_is_heard_to_its_end() {
        let output = output(&mut shell("cat; echo one; echo two >&2; exit 7")).expect("it ends");
        assert_eq!(
            (output.status.code(), &output.stdout[..], &output.stderr[..]),
            (Some(7), &b"one\n"[..], &b"two\n"[..])
        );
        let long = output_within(PATIENCE, &mut shell("head -c 1000000 /dev/zero")).expect("it ends");
        assert_eq!(long.stdout.len(), 1_000_000, "more than a pipe holds");
    }

    #[test]
    fn a_program_that_does_not_end_is_killed_and_its_output_is_reported() {
        let mut endless = shell("echo begun; echo in earnest >&2; sleep 1000; echo over");
        let error = output_within(Duration::from_secs(3), &mut endless).expect_err("it does not end");
        let words = error.to_string();
        assert_eq!(error.kind(), ErrorKind::TimedOut);
        assert!(words.contains("3s") && words.contains("begun\nin earnest\n") && !words.contains("over"), "{words}");
    }

    #[test]
    fn what_a_killed_program_has_started_is_killed_too() {
        let mut command = shell("sleep 1000 & echo begun; wait");
        lead_group(&mut command);
        let mut child = command.stdout(Stdio::piped()).spawn().expect("a shell");
        let heard = Heard::of(child.stdout.take().expect("piped"));
        assert!(comes(PATIENCE, || heard.text() == "begun\n"), "{}", heard.text());
        assert!(!heard.is_over(), "both may still write");
        kill_group(&mut child);
        assert!(comes(PATIENCE, || heard.is_over()), "the one that was started has the pipe still");
    }
}
