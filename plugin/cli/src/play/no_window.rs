//! `playbot play` in a program without the window feature.

use playbot_lab::games::Games;

use super::Args;
use crate::error::{CliError, Outcome};

/// Returns the error of a program without a window, with the command that builds one.
pub fn run(_: Args, _: &Games) -> Result<Outcome, CliError> {
    Err(no_window())
}

/// Returns the error of a program without a window, with the command that builds one.
pub fn no_window() -> CliError {
    CliError::Usage(
        "this program was built without a window: it needs the feature `window` of `playbot_cli` (in your own Cargo.toml, \
         `features = [\"window\"]` of that dependency; for `playbot`, `cargo build --release --features window`), and no \
         system packages"
            .to_owned(),
    )
}
