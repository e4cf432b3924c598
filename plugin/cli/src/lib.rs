//! Bots that test the levels of Bevy games: the crate of a game's tests and of its bots.
//!
//! A program that describes its game and calls [`main`](main()) has every verb of the command line: `playbot test` as
//! `cargo run -- test`, and so on.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use playbot::ForeignGame;
//!
//! /// The game's own plugins.
//! fn game(app: &mut App) {
//!     app.add_systems(Startup, |mut commands: Commands| {
//!         commands.spawn(Name::new("hero"));
//!     });
//! }
//!
//! fn my_game() -> ForeignGame {
//!     ForeignGame::new("my-game", 1, game)
//!         .keys([vec![], vec![KeyCode::Space]])
//!         .observe(["time"], |time: Res<Time>| [time.elapsed_secs()])
//!         .time_limit(600)
//! }
//!
//! fn main() -> std::process::ExitCode {
//!     playbot::main(&[&my_game()])
//! }
//!
//! #[test]
//! fn levels_can_be_solved() {
//!     playbot::test(&my_game()).levels("default:0..9").assert_levels_solvable();
//! }
//! ```
//!
//! # Contents, in reading order
//!
//! - [`prelude`]: the imports of a game's bots and tests.
//! - [`ForeignGame`] wraps a game as it is. [`Game`] is the contract behind it, for games that want more.
//! - [`test()`](fn@test) and [`LevelTest`]: assertions for `cargo test`.
//! - [`main`](main()): the command line. [`check_usage`] checks a command line, [`mod@reference`] describes all verbs.
//! - [`harness`], [`bridge`], [`mod@test`], [`train`], [`mutation`], [`learner`], [`report`]: the crates behind it, for programs
//!   that call them directly.
//! - [`pictures`]: steps of an episode as PNGs. `window` (a feature): a window for people.
//!
//! Inside, each verb is a file in `verbs/`. Verbs share their options (`arguments`), what they print and write (`output`),
//! progress and Ctrl-C (`progress`), and errors with exit codes (`error`). Data goes to standard output, everything else
//! to standard error.

#![allow(clippy::print_stdout, reason = "a command line prints")]
#![allow(clippy::test_attr_in_doctest, reason = "the example shows a game's own test, and need only compile")]

#[macro_use]
mod output;
mod arguments;
mod command_line;
mod error;
mod loopback;
pub mod pictures;
mod progress;
pub mod reference;
mod verbs;
#[cfg(feature = "window")]
pub mod window;

pub use crate::command_line::{check_usage, main};

/// Compiles the code blocks of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub use playbot_bridge as bridge;
pub use playbot_harness as harness;
pub use playbot_learner as learner;
pub use playbot_mutation as mutation;
pub use playbot_report as report;
pub use playbot_test as test;
pub use playbot_train as train;

pub use playbot_harness::{foreign::ForeignGame, game::Game};
pub use playbot_test::assertions::{LevelTest, test};

/// The items that the bots and tests of a game need, in one import.
pub mod prelude {
    pub use bevy_playbot::episode::EpisodeEnd;
    pub use bevy_playbot::virtual_input::PointerPosition;
    pub use playbot_harness::floor_plan::FloorPlan;
    pub use playbot_harness::foreign::{ForeignGame, LevelFromFile, LevelSeed, PlayedAgent, PlayedMode, Restart};
    pub use playbot_harness::prelude::*;
    pub use playbot_test::assertions::LevelTest;
}
