//! Recordings: making them with a demonstrator, verifying them by replay, and reading them for learning.

mod action_noise;
mod chosen;
pub mod dataset;
pub mod demonstration;
mod observe;
mod replay_observations;
mod replayed;
mod rollouts;
mod seen_levels;
pub mod verify;
