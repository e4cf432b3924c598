//! Ctrl-C: the first one asks the running work to stop at the next good place, the second one stops at once.

use std::sync::{
    OnceLock,
    atomic::{AtomicBool, Ordering},
};

/// The exit code of work that was stopped, as shells have it: 128 and the number of the signal.
pub const EXIT_CODE: u8 = 130;

static ASKED: AtomicBool = AtomicBool::new(false);
static INSTALLED: OnceLock<()> = OnceLock::new();

/// Listens for Ctrl-C and for a polite kill from now on.
pub fn listen() {
    INSTALLED.get_or_init(|| {
        let installed = ctrlc::set_handler(|| {
            if ASKED.swap(true, Ordering::SeqCst) {
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
