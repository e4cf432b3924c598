//! `playbot replay --window` in a program without the window feature.

use playbot_lab::{findings::StoredFinding, game::Game};

use crate::{error::CliError, play::no_window};

/// Returns the error of a program without a window, with the command that builds one, and options that need none.
pub fn show(_: &dyn Game, _: &StoredFinding) -> Result<(), CliError> {
    Err(CliError::Usage(format!("{}; --png FILE and --apng FILE draw the finding without one", no_window())))
}
