//! Extraction, for build scripts, of a game from the examples of the `bevy` package, which cargo has already
//! downloaded. It writes a copy into `OUT_DIR` that has a function over an app where the example has its `main`.
//!
//! The examples themselves stay as they are, and no part of them is kept in this repository.

mod find;
mod rewrite;
mod write_game;

pub use rewrite::rewrite;
pub use write_game::write_game;
