//! `playbot play`.
//!
//! The folder: `window`, the verb in a program that was built with a window.

#[cfg(feature = "window")]
mod window;

#[cfg(not(feature = "window"))]
use crate::error::{CliError, Outcome};
use crate::{
    arguments::{OverwriteArgs, player::PlayerArgs},
    output,
};
#[cfg(not(feature = "window"))]
use playbot_harness::games::Games;
use std::path::PathBuf;

#[cfg(feature = "window")]
pub use crate::verbs::play::window::run;

/// Play in a window, record, and hand over to a policy and back.
#[derive(clap::Args)]
#[command(after_help = "Keys:
  those of the game, printed at the start
  Tab        hand over to the policy or bot, and take over again
  F9         record what you play (into GAME.demo, or the file of --record), and end it
  F10        learn from the recording in the background, and stop it; Tab then hands over to what was learned so far
  R, N       play the level again, go to the next one
  P          pause
  F8         hide the overlay and show it: what decides, action, value, skill, and notes of detectors
  -, =       see more, see less
  V          from above or in space, if the game has that view and the program the feature view3d
  Escape     end, as do Ctrl-Q and closing the window

A won level is followed by the next one, a lost one is played again. Every finished episode is on disk at once.

The time limit of a game's adapter suits bots. Without it (--no-time-limit) a person has all the time that a level takes,
and such a recording replays, verifies and is learned from like any other.

Examples:
  playbot play GAME --level 7
  playbot play GAME --levels 0..63 --record my.demo
  playbot play GAME --no-time-limit --record slow.demo
  playbot play GAME --levels 'files:levels/*.json'
  playbot play GAME --run runs/first --record mixed.demo
  playbot play GAME --mode MODE --bot BOT")]
#[cfg_attr(not(feature = "window"), allow(dead_code, reason = "read by the window only"))]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game (default: that of the levels, or else the one that `train` trains in).
    #[arg(long)]
    mode: Option<String>,
    /// Number of the level to begin with, also as mode:number, or its name in a level editor (default: the first of the
    /// levels).
    #[arg(long, value_name = "N")]
    level: Option<u64>,
    /// Random seed of the autopilot's draws (default: 0).
    #[arg(long)]
    seed: Option<u64>,
    /// Levels, as first..last or mode:first..last, both included, as files:pattern, such as "files:levels/*.json", or by
    /// their names in a level editor (default: all).
    #[arg(long)]
    levels: Option<String>,
    /// Play without the time limit of the game's adapter (`.time_limit`), which also cuts off the autopilot. A limit that
    /// is a rule of the game itself stays.
    #[arg(long)]
    no_time_limit: bool,
    /// Recording to write, a .demo.
    #[arg(long, value_name = "FILE", value_parser = output::demo)]
    record: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteArgs,
    /// Name of the player, for the recording.
    #[arg(long, default_value = "human")]
    name: String,
    /// The autopilot, which takes over with Tab.
    #[command(flatten)]
    autopilot: PlayerArgs,
}

/// Returns the error of a program without a window, with the command that builds one.
#[cfg(not(feature = "window"))]
pub fn run(_: Args, _: &Games) -> Result<Outcome, CliError> {
    Err(no_window())
}

/// Returns the error of a program without a window, with the command that builds one.
#[cfg(not(feature = "window"))]
pub fn no_window() -> CliError {
    CliError::Usage(
        "this program was built without a window: it needs the feature `window` of `playbot` (in your own Cargo.toml, \
         `features = [\"window\"]` of that dependency; for the program `playbot`, `--features window` behind `cargo build` or \
         `cargo install`), and no system packages"
            .to_owned(),
    )
}
