//! Ctrl-C: the first one asks the running work to stop at the next safe point, the second one stops at once. Work that
//! reaches no safe point in time is stopped where it is. All saved files are whole, and the work can be resumed from
//! the last of them.

#[cfg(unix)]
use signal_hook::{
    consts::{SIGHUP, SIGINT, SIGTERM},
    flag,
};
#[cfg(unix)]
use std::{
    fs, io,
    sync::{Arc, atomic::AtomicUsize},
};
use std::{
    sync::{
        Mutex, OnceLock, PoisonError,
        atomic::{AtomicBool, AtomicU8, Ordering},
    },
    thread,
    time::Duration,
};

/// The number of Ctrl-C's signal.
const INTERRUPT: u8 = 2;

/// Time in which work must reach a safe point to stop. The user waits for two seconds at most, some of which the end
/// needs.
const PATIENCE: Duration = Duration::from_millis(1400);

/// Time between two looks for a signal.
#[cfg(unix)]
const GLANCE: Duration = Duration::from_millis(20);

/// The number of the first signal.
static FIRST: AtomicU8 = AtomicU8::new(INTERRUPT);

/// Ctrl-C was pressed; a second one stops at once.
static HEARD: AtomicBool = AtomicBool::new(false);

/// True once stopped work only sums up what it has.
static SUMS_UP: AtomicBool = AtomicBool::new(false);

/// Work is to stop.
static ASKED: AtomicBool = AtomicBool::new(false);

/// Work need not reach a safe point to stop.
static NOTHING_TO_SAVE: AtomicBool = AtomicBool::new(false);

static INSTALLED: OnceLock<()> = OnceLock::new();

static REMAINS: Mutex<Remains> = Mutex::new(Remains { left: None, command: None });

/// Information that is printed when a second Ctrl-C stops the work.
struct Remains {
    /// The saved part, in words.
    left: Option<String>,
    /// The command that resumes it.
    command: Option<String>,
}

impl Remains {
    fn words(&self) -> String {
        let left = self.left.as_deref().unwrap_or("unsaved work is lost");
        let command = self.command.as_ref().map_or_else(String::new, |command| format!(": go on with {command}"));
        format!("{left}{command}")
    }
}

/// Listens for Ctrl-C from now on; on Unix also for SIGTERM and SIGHUP. A signal that the program was started to ignore,
/// as by `nohup`, stays ignored.
pub(crate) fn listen() {
    INSTALLED.get_or_init(|| {
        if let Err(error) = install() {
            tracing::warn!("Ctrl-C will stop at once, without saving: {error}");
        }
    });
}

#[cfg(unix)]
fn install() -> io::Result<()> {
    let ignored = ignored_signals(&fs::read_to_string("/proc/self/status").unwrap_or_default());
    let mut heard = [SIGHUP, SIGINT, SIGTERM].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    // The number of the last signal, or 0.
    let sent = Arc::new(AtomicUsize::new(0));
    let seen = Arc::clone(&sent);
    // A handler may do next to nothing, so a thread looks whether it was called. It comes first: a signal that is
    // caught is no longer deadly, and must be seen.
    thread::Builder::new().spawn(move || {
        loop {
            thread::park_timeout(GLANCE);
            match u8::try_from(seen.swap(0, Ordering::SeqCst)) {
                Ok(0) | Err(_) => {}
                Ok(signal) => hear(signal),
            }
        }
    })?;
    heard.try_for_each(|signal| flag::register_usize(signal, Arc::clone(&sent), signal as usize).map(drop))
}

#[cfg(not(unix))]
fn install() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| hear(INTERRUPT))
}

/// Returns the ignored signals of a process, a bit for each from signal 1 on, by Linux' description of the process.
/// Without one, as on macOS, no signal counts as ignored.
#[cfg(unix)]
fn ignored_signals(status: &str) -> u64 {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

/// Work that has nothing to save: while this lives, the first Ctrl-C ends the program where it is. Earlier saved parts,
/// if any, are printed.
pub struct NothingToSave(());

impl NothingToSave {
    /// Listens for Ctrl-C from now on.
    pub fn listen() -> Self {
        NOTHING_TO_SAVE.store(true, Ordering::SeqCst);
        listen();
        Self(())
    }
}

impl Drop for NothingToSave {
    fn drop(&mut self) {
        NOTHING_TO_SAVE.store(false, Ordering::SeqCst);
    }
}

/// Handles the signal of this number.
fn hear(signal: u8) {
    if HEARD.swap(true, Ordering::SeqCst) {
        stop("stopped at once");
    }
    FIRST.store(signal, Ordering::SeqCst);
    if NOTHING_TO_SAVE.load(Ordering::SeqCst) {
        stop("stopped");
    }
    report!("\nstopping after this step, or within two seconds; {}", second(signal));
    // Set after the message, since the last words are for the saved parts.
    ASKED.store(true, Ordering::SeqCst);
    if thread::Builder::new().spawn(stop_in_time).is_err() {
        // No other thread is left for it.
        stop_in_time();
    }
}

/// Stops work that reaches no safe point.
#[expect(clippy::disallowed_methods, reason = "people wait by the clock, and nothing is simulated here")]
fn stop_in_time() {
    thread::sleep(PATIENCE);
    if SUMS_UP.load(Ordering::SeqCst) {
        return;
    }
    stop("stopped within a step, which would have taken longer")
}

/// Ends the program where it is.
fn stop(how: &str) -> ! {
    // Held to the end, so that only one of several stopping threads prints.
    let remains = REMAINS.lock().unwrap_or_else(PoisonError::into_inner);
    report!("\n{how}; {}", remains.words());
    std::process::exit(exit_code().into())
}

/// Describes the effect of a second signal.
fn second(signal: u8) -> &'static str {
    match signal {
        INTERRUPT => "press Ctrl-C again to stop at once and lose it",
        _ => "another signal stops at once and loses it",
    }
}

/// Returns the exit code of stopped work, as in shells: 128 and the number of the signal.
pub(crate) fn exit_code() -> u8 {
    128 + FIRST.load(Ordering::SeqCst)
}

/// Asks the work to stop at its next safe point, without a limit of time.
pub(crate) fn ask() {
    ASKED.store(true, Ordering::SeqCst);
}

/// Returns true if Ctrl-C was pressed, or the work was asked to stop otherwise.
pub(crate) fn asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}

/// Returns true if Ctrl-C was pressed. From then on the work only sums up what it has, for as long as that takes.
pub(crate) fn asked_to_sum_up() -> bool {
    let is_asked = asked();
    if is_asked {
        SUMS_UP.store(true, Ordering::SeqCst);
    }
    is_asked
}

/// Notes the saved part, in words, for the message of a second Ctrl-C.
pub(crate) fn leave(left: String) {
    REMAINS.lock().unwrap_or_else(PoisonError::into_inner).left = Some(left);
}

/// Returns the noted words, for the message at a safe point.
pub(crate) fn remains() -> String {
    REMAINS.lock().unwrap_or_else(PoisonError::into_inner).words()
}

/// Notes the command that resumes the work, for the message of a second Ctrl-C.
pub(crate) fn go_on_with(command: String) {
    REMAINS.lock().unwrap_or_else(PoisonError::into_inner).command = Some(command);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn what_was_to_be_ignored_is_read_from_the_process() {
        let status =
            "Name:\tplaybot\nSigBlk:\t0000000000000000\nSigIgn:\t0000000000001003\nSigCgt:\t0000000000000440\n";
        assert_eq!(ignored_signals(status), 0b1_0000_0000_0011);
        assert_eq!(ignored_signals(""), 0);
    }

    #[test]
    fn without_another_signal_stopped_work_counts_as_interrupted() {
        assert_eq!(exit_code(), 130);
        let words = [INTERRUPT, 15].map(second);
        assert_eq!(
            words,
            ["press Ctrl-C again to stop at once and lose it", "another signal stops at once and loses it"]
        );
    }

    #[test]
    fn the_last_words_say_what_is_left_and_how_to_go_on() {
        let nothing = Remains { left: None, command: None };
        assert_eq!(nothing.words(), "unsaved work is lost");
        let left = Some("the last checkpoint of a is that of step 81,920".to_owned());
        let saved = Remains { left, command: Some("`playbot train --run a --resume`".to_owned()) };
        let words = "the last checkpoint of a is that of step 81,920: go on with \
                     `playbot train --run a --resume`";
        assert_eq!(saved.words(), words);
    }
}
