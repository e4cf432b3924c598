//! Assertions about levels, for a game's own `cargo test`.
//!
//! ```
//! use bevy::prelude::*;
//! use playbot_lab::{
//!     assertions::{LevelTest, assert_deterministic, assert_levels_solvable},
//!     foreign::{ForeignGame, Restart},
//!     prelude::*,
//! };
//!
//! #[derive(Component)]
//! struct Walker;
//!
//! fn game(app: &mut App) {
//!     app.add_systems(Startup, |mut commands: Commands| {
//!         commands.spawn((Walker, Transform::default()));
//!     })
//!     .add_systems(Update, |keys: Res<ButtonInput<KeyCode>>, mut walker: Single<&mut Transform, With<Walker>>| {
//!         walker.translation.x += f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
//!     });
//! }
//!
//! fn walk() -> ForeignGame {
//!     ForeignGame::new("walk", 1, game)
//!         .keys([vec![], vec![KeyCode::ArrowRight]])
//!         .observe(["x"], |walker: Single<&Transform, With<Walker>>| [walker.translation.x])
//!         .end(|walker: Single<&Transform, With<Walker>>| (walker.translation.x >= 5.0).then_some(EpisodeEnd::WON))
//!         .time_limit(20)
//!         .restart(Restart::Startup)
//!         .demonstrator("walker", || 1_u32)
//! }
//!
//! // In a function with `#[test]`:
//! assert_levels_solvable(&walk(), "default:0..3");
//! assert_deterministic(&walk(), "default:0..1");
//! LevelTest::new(&walk(), "default:0..3").bot("walker").episodes(2).assert_solved();
//! ```
//!
//! Levels are named as on the command line: `MODE:first..last`, both included, or `files:levels/**/*.json`. Paths are
//! relative to the folder of the package, in which `cargo test` runs tests. A range without a level is a failure, and
//! so is any other reason why levels cannot be tested.
//!
//! A failure names each broken level with its defect, and the commands that show it. Failed episodes and findings are
//! written below `target/playbot-findings`, so that `playbot replay` shows them; `playbot` stands for the program with
//! the game.

mod assert_levels;
mod assert_recordings;
mod commands;
mod error;
mod evidence;
mod examine;
mod failure;
mod level_test;
mod testers;
mod usual_folder;
mod wanted;

pub use assert_levels::{assert_deterministic, assert_levels_solvable, assert_levels_solved_by, assert_no_findings};
pub use assert_recordings::{assert_findings_gone, assert_replays};
pub use error::LevelTestError;
pub use level_test::LevelTest;
