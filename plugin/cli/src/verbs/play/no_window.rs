//! `playbot play` in a program without the window feature.

use crate::{
    error::{CliError, Outcome},
    verbs::play::Args,
};
use playbot_harness::games::Games;

/// Returns the error of a program without a window, with the command that builds one.
pub fn run(_: Args, _: &Games) -> Result<Outcome, CliError> {
    Err(no_window())
}

/// Returns the error of a program without a window, with the command that builds one.
pub fn no_window() -> CliError {
    CliError::Usage(
        "this program was built without a window: it needs the feature `window` of `playbot` (in your own Cargo.toml, \
         `features = [\"window\"]` of that dependency; for the program `playbot`, `--features window` behind `cargo build` or \
         `cargo install`), and no system packages"
            .to_owned(),
    )
}
