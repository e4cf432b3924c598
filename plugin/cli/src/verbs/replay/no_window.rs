//! `playbot replay --window` in a program without the window feature.

use crate::{error::CliError, verbs::play::no_window};
use playbot_harness::game::Game;
use playbot_test::findings::StoredFinding;

/// Returns the error of a program without a window, with the command that builds one, and options that need none.
pub(crate) fn show(_: &dyn Game, _: &StoredFinding) -> Result<(), CliError> {
    Err(CliError::Usage(format!("{}; --png FILE and --apng FILE draw the finding without one", no_window())))
}
