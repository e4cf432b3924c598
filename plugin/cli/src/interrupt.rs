//! Ctrl-C: the first one asks the running work to stop at the next good place, the second one stops at once.

use std::sync::{
    Mutex, OnceLock, PoisonError,
    atomic::{AtomicBool, Ordering},
};

/// The exit code of work that was stopped, as shells have it: 128 and the number of the signal.
pub const EXIT_CODE: u8 = 130;

static ASKED: AtomicBool = AtomicBool::new(false);
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
        format!("stopped at once; {left}{command}")
    }
}

/// Listens for Ctrl-C and for a polite kill from now on.
pub fn listen() {
    INSTALLED.get_or_init(|| {
        let installed = ctrlc::set_handler(|| {
            if ASKED.swap(true, Ordering::SeqCst) {
                tell!("\n{}", REMAINS.lock().unwrap_or_else(PoisonError::into_inner).words());
                std::process::exit(EXIT_CODE.into());
            }
            tell!("\nstopping after this step; press Ctrl-C again to stop at once and lose it");
        });
        if let Err(error) = installed {
            tracing::warn!("Ctrl-C will stop at once, without saving: {error}");
        }
    });
}

/// Whether somebody asked to stop.
pub fn asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}

/// Notes what is saved now, in words for whoever stops the work at once.
pub fn leave(left: String) {
    REMAINS.lock().unwrap_or_else(PoisonError::into_inner).left = Some(left);
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
        assert_eq!(nothing.words(), "stopped at once; what was not saved is lost");
        let left = Some("the last checkpoint of a is that of step 81,920".to_owned());
        let saved = Remains { left, command: Some("`playbot train --run a --resume`".to_owned()) };
        let words = "stopped at once; the last checkpoint of a is that of step 81,920: go on with \
                     `playbot train --run a --resume`";
        assert_eq!(saved.words(), words);
    }
}
