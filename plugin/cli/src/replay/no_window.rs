//! Showing a finding in a program that was built without a window.

use playbot_lab::{findings::StoredFinding, game::Game};

use crate::{error::CliError, play::no_window};

/// Says how to build one with a window, and what needs none.
pub fn show(_: &dyn Game, _: &StoredFinding) -> Result<(), CliError> {
    Err(CliError::Usage(format!("{}; --png FILE and --apng FILE draw the finding without one", no_window())))
}
