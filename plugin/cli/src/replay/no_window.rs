//! Showing a finding in a program that was built without a window.

use playbot_lab::{findings::StoredFinding, game::Game};

use crate::{error::CliError, play::no_window};

/// Says how to build one with a window.
pub fn show(_: &dyn Game, _: &StoredFinding) -> Result<(), CliError> {
    Err(no_window())
}
