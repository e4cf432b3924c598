//! Taking over a shipped build: recording testers, letting a policy play, replaying a recording, without another program.
//!
//! A game with [`PlaybotPlugins`](crate::plugins::PlaybotPlugins) reads the environment variable
//! `PLAYBOT` when it starts:
//!
//! ```text
//! PLAYBOT=record:ada.demo ./game       record every episode of the agents that play
//! PLAYBOT=policy:walker.policy ./game  a policy plays instead
//! PLAYBOT=replay:ada.demo ./game       a recording plays instead
//! ```
//!
//! F9, or the key of [`TakeoverPlugin::key`], stops and restarts it. Without `PLAYBOT` the key
//! starts a recording named for the game. An existing recording is continued, and
//! [`merge_demos`](crate::demo::file::merge_demos) joins those of many testers. `PLAYBOT_NAME`
//! names the player.
//!
//! An impossible request triggers a [`FaultOccurred`](crate::fault::FaultOccurred), and the game
//! goes on unchanged. A World that is ticked by hand, as in training, cannot be taken over.
//!
//! ```
//! use bevy_playbot::takeover::TakeoverRequest;
//!
//! let request: TakeoverRequest = "record:ada.demo".parse().expect("valid");
//! assert_eq!(request, TakeoverRequest::Record("ada.demo".into()));
//! let error = "rekord:ada.demo".parse::<TakeoverRequest>().expect_err("no such way").to_string();
//! assert!(error.contains("did you mean `record`?"));
//! ```

mod error;
mod identity;
mod play_policy;
mod play_replay;
mod plugin;
mod record;
mod request;
mod seats;

pub use error::TakeoverError;
pub use identity::GameIdentity;
pub use plugin::{Takeover, TakeoverPlugin};
pub use request::{RequestError, TakeoverRequest};
