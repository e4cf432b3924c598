//! Playing in a program that was built without a window.

use playbot_lab::games::Games;

use super::Args;
use crate::error::{CliError, Outcome};

/// Says how to build one with a window.
pub fn run(_: Args, _: &Games) -> Result<Outcome, CliError> {
    Err(no_window())
}

/// How to build a program with a window.
pub fn no_window() -> CliError {
    CliError::Usage(
        "this program was built without a window: it needs the feature `window` of `playbot_cli` (in your own Cargo.toml, \
         `features = [\"window\"]` of that dependency; for `playbot`, `cargo build --release --features window`), and no \
         system packages"
            .to_owned(),
    )
}
