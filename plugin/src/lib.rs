//! Gameplay-testing agents for [Bevy](https://bevyengine.org).
//!
//! # Concepts
//!
//! - An [`Agent`](agent::Agent) is an entity that acts in the game. Each fixed tick its sensors
//!   fill an [`Observation`](observation::Observation), and the source that its
//!   [`Control`](agent::Control) names writes its [`Action`](action::Action). The game answers
//!   with a [`Reward`](reward::Reward) and eventually with the end of the
//!   [`Episode`](episode::Episode).
//! - A *level* is identified by a number. The plugin takes it from the agent's
//!   [`LevelQueue`](level::LevelQueue) and triggers [`StartEpisode`](episode::StartEpisode); the
//!   game builds the level in an observer.
//! - An episode ends as [`Terminated`](episode::EpisodeEnd::Terminated) (the game is over: won or
//!   lost) or [`Truncated`](episode::EpisodeEnd::Truncated) (time is up). The two are never merged:
//!   no reward can follow a termination, but reward could have followed a truncation.
//! - A [`SkillPrior`](skill_prior::SkillPrior) draws a skill z for each agent every T ticks. The
//!   policy decodes z, together with the observation, into actions.
//! - [`demo`] records the actions of people, bots and policies, and replays them bit by bit.
//! - A [`policy_file`] brings a trained policy into a game that ships with it.
//!
//! Training, evaluation and reports are in `playbot`, with a command line for any list of games.
//!
//! # One tick
//!
//! ```text
//! FixedPreUpdate   PlaybotSystems::Begin → Load → Observe → Decide → Act
//! FixedUpdate      the game
//! FixedPostUpdate  PlaybotSystems::Judge → Record → Reset
//! ```
//!
//! `Load` is for games whose levels take several frames to build. Until
//! [`Episode::ready`](episode::Episode::ready) is called, the agent is not observed and its ticks
//! are not counted. For a game that simulates in `Update` each frame is a tick
//! ([`TickPlacement::Frame`](placement::TickPlacement::Frame)): the first line then runs in
//! `PreUpdate`, the last in `Last`.
//!
//! # A game in thirty lines
//!
//! The agent stands on a line and must walk five steps to the right.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//!
//! #[derive(Component, Default)]
//! struct Position(i32);
//!
//! fn restart(event: On<StartEpisode>, mut positions: Query<&mut Position>) {
//!     if let Ok(mut position) = positions.get_mut(event.entity) {
//!         position.0 = 0;
//!     }
//! }
//!
//! fn see(mut agents: Query<(&Position, &mut Observation)>) {
//!     for (position, mut observation) in &mut agents {
//!         observation.set([position.0 as f32]);
//!     }
//! }
//!
//! fn walk(mut agents: Query<(&Action, &mut Position, &mut Reward, &mut Episode)>) {
//!     for (action, mut position, mut reward, mut episode) in &mut agents {
//!         position.0 += if action.discrete() == Some(1) { 1 } else { -1 };
//!         if position.0 == 5 {
//!             reward.add(1.0);
//!             episode.terminate(true);
//!         }
//!     }
//! }
//!
//! let mut app = headless_app();
//! app.add_observer(restart)
//!     .add_systems(ObserveSchedule, see)
//!     .add_systems(FixedUpdate, walk);
//! let agent = app
//!     .world_mut()
//!     .spawn((
//!         Agent::new(0, ActionSpace::Discrete(2)),
//!         VectorSensor::new(["position"]),
//!         Control::Bot,
//!         BlindBot::Constant(ActionValue::Discrete(1)),
//!         Position::default(),
//!     ))
//!     .id();
//! app.ticks(5).expect("no agent broke its contract");
//! let finished = app.world().get::<EpisodeCount>(agent).expect("required by Agent");
//! assert_eq!(finished.finished, 1);
//! assert_eq!(finished.successes, 1);
//! ```

pub mod action;
pub mod agent;
pub mod bot;
mod calls;
#[cfg(feature = "camera")]
pub mod camera;
mod carry_over;
pub mod demo;
pub mod engine;
pub mod entities;
pub mod episode;
pub mod fault;
pub mod headless;
pub mod key_bindings;
pub mod legal;
pub mod lesson;
pub mod level;
mod loading;
pub mod observation;
#[cfg(feature = "overlay")]
pub mod overlay;
mod own_policy;
mod panics;
pub mod placement;
pub mod plugin;
pub mod policy;
mod policy_batch;
pub mod policy_file;
pub mod prelude;
pub mod raster;
mod renewal;
pub mod reward;
pub mod skill_prior;
pub mod state_hash;
pub mod streams;
mod system_errors;
pub mod systems;
pub mod takeover;
pub mod test_app;
pub mod unknown_name;
pub mod virtual_input;
pub mod vision;

pub use crate::plugin::{PlaybotPlugin, PlaybotPlugins};

/// Compiles the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
