//! Headless play of a game of [`bevy_playbot`]: games, Worlds, levels, sensors, players and the doctor.
//!
//! A program describes its game once, as a [`Game`](game::Game), or wraps the function that adds it to an app in a
//! [`ForeignGame`](foreign::ForeignGame). Everything else builds Worlds of it, as many as the cores can play, and ticks
//! them without a window. An episode depends on the level, the player and the random seed, and on nothing else. Most
//! programs use this crate through `playbot`, as `playbot::harness`.
//!
//! The modules, in reading order:
//!
//! - a game: [`game`], the contract of games and their optional tools; [`foreign`], games that are not written for this
//!   plugin; [`games`], the games of a program; [`mode`], errors of modes; [`prelude`], the imports of a game.
//! - its levels: [`split`], named ranges of levels; [`level_files`], levels from files; [`floor_plan`], their plans.
//! - its Worlds: [`worlds`], headless Worlds with any number of agents, and the episodes that ended in them;
//!   [`sensors`], what their agents see; [`saved_episode`], episodes that are saved in the middle;
//!   [`randomise`], values of the game that each level draws anew.
//! - its players: [`eval`], evaluation of players on levels; [`rivals`], players of other seats, and matches with them; [`demo`], recordings made and verified; [`detector`], the
//!   contract of detectors of defects; [`defect`], the kinds of planted defects.
//! - views: [`doctor`], the examination of a game's determinism; [`inspect`], single levels and steps; [`trace`], given
//!   actions tick by tick; [`drawing`], shapes as SVG or pixels; [`trails`], charts of where agents went.
//! - the machine: [`parallel`], work on a few threads; [`machine`], memory and threads that are left; [`benchmark`],
//!   the benchmarks of a game; [`sealed_file`], files with a checksum; [`brief`], texts for error messages.
//!
//! ```
//! use bevy::prelude::*;
//! use playbot_harness::{foreign::ForeignGame, prelude::*, worlds::build_world};
//!
//! /// The game's own plugins.
//! fn game(app: &mut App) {
//!     app.add_systems(Startup, |mut commands: Commands| {
//!         commands.spawn(Name::new("hero"));
//!     });
//! }
//!
//! let game = ForeignGame::new("wait", 1, game)
//!     .keys([vec![], vec![KeyCode::Space]])
//!     .observe(["time"], |time: Res<Time>| [time.elapsed_secs()])
//!     .time_limit(3);
//! let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
//! world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([7])));
//! while world.get::<Control>(agents[0]) != Some(&Control::Idle) {
//!     world.tick().expect("the game keeps its contract");
//! }
//! assert_eq!(world.get::<EpisodeCount>(agents[0]).expect("an agent").finished, 1);
//! ```

pub mod benchmark;
pub mod brief;
pub mod defect;
pub mod demo;
pub mod detector;
pub mod doctor;
pub mod drawing;
pub mod eval;
pub mod floor_plan;
pub mod foreign;
pub mod game;
pub mod games;
pub mod held_out;
pub mod inspect;
pub mod level_audit;
pub mod level_files;
pub mod machine;
pub mod mode;
pub mod parallel;
pub mod prelude;
pub mod randomise;
mod reflected_path;
pub mod rivals;
pub mod saved_episode;
pub mod sealed_file;
pub mod sensors;
pub mod single_actions;
pub mod split;
pub mod trace;
pub mod trails;
pub mod worlds;
