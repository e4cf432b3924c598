//! Ctrl-C: the first one asks the running work to stop at the next good place, the second one stops at once. Work that has no
//! good place in time is stopped where it is: everything that was saved is whole, and the last of it goes on.

use std::{
    sync::{
        Mutex, OnceLock, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

/// The exit code of work that was stopped, as shells have it: 128 and the number of the signal.
pub const EXIT_CODE: u8 = 130;

/// How long work may look for a good place to stop. Whoever asks waits for two seconds at most, some of which the end needs.
const PATIENCE: Duration = Duration::from_millis(1400);

/// Somebody asked to stop; whoever asks again does not want to wait.
static HEARD: AtomicBool = AtomicBool::new(false);
/// Work is to stop.
static ASKED: AtomicBool = AtomicBool::new(false);
/// Work need not look for a good place to stop.
static NOTHING_TO_SAVE: AtomicBool = AtomicBool::new(false);
static INSTALLED: OnceLock<()> = OnceLock::new();
static REMAINS: Mutex<Remains> = Mutex::new(Remains { left: None, command: None });

/// What a second Ctrl-C does not take away.
struct Remains {
    /// What is saved.
    left: Option<String>,
    /// What goes on with it.
    command: Option<String>,
}

impl Remains {
    fn words(&self) -> String {
        let left = self.left.as_deref().unwrap_or("what was not saved is lost");
        let command = self.command.as_ref().map_or_else(String::new, |command| format!(": go on with {command}"));
        format!("{left}{command}")
    }
}

/// Listens for Ctrl-C and for a polite kill from now on.
pub fn listen() {
    INSTALLED.get_or_init(|| {
        if let Err(error) = ctrlc::set_handler(hear) {
            tracing::warn!("Ctrl-C will stop at once, without saving: {error}");
        }
    });
}

/// Work that has nothing to save: while there is this, the first Ctrl-C ends the program where it is. What was saved before, if
/// anything, is told.
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

/// What is done about a signal.
fn hear() {
    if HEARD.swap(true, Ordering::SeqCst) {
        stop("stopped at once");
    }
    if NOTHING_TO_SAVE.load(Ordering::SeqCst) {
        stop("stopped");
    }
    tell!("\nstopping after this step, or within two seconds; press Ctrl-C again to stop at once and lose it");
    // Not before that is said: the last words are for what the work leaves.
    ASKED.store(true, Ordering::SeqCst);
    if thread::Builder::new().spawn(stop_in_time).is_err() {
        // There is no thread for it but this one.
        stop_in_time();
    }
}

/// Stops work that finds no good place.
#[expect(clippy::disallowed_methods, reason = "people wait by the clock, and nothing is simulated here")]
fn stop_in_time() {
    thread::sleep(PATIENCE);
    stop("stopped within a step, which would have taken longer")
}

/// Ends the program where it is.
fn stop(how: &str) -> ! {
    // Held to the end, so that of several threads that stop one speaks.
    let remains = REMAINS.lock().unwrap_or_else(PoisonError::into_inner);
    tell!("\n{how}; {}", remains.words());
    std::process::exit(EXIT_CODE.into())
}

/// Whether somebody asked to stop.
pub fn asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}

/// Notes what is saved now, in words for whoever stops the work at once.
pub fn leave(left: String) {
    REMAINS.lock().unwrap_or_else(PoisonError::into_inner).left = Some(left);
}

/// What was noted, in words for whoever was stopped at a good place.
pub fn remains() -> String {
    REMAINS.lock().unwrap_or_else(PoisonError::into_inner).words()
}

/// Notes what goes on with the work, in words for whoever stops it at once.
pub fn go_on_with(command: String) {
    REMAINS.lock().unwrap_or_else(PoisonError::into_inner).command = Some(command);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_words_say_what_is_left_and_how_to_go_on() {
        let nothing = Remains { left: None, command: None };
        assert_eq!(nothing.words(), "what was not saved is lost");
        let left = Some("the last checkpoint of a is that of step 81,920".to_owned());
        let saved = Remains { left, command: Some("`playbot train --run a --resume`".to_owned()) };
        let words = "the last checkpoint of a is that of step 81,920: go on with \
                     `playbot train --run a --resume`";
        assert_eq!(saved.words(), words);
    }
}
