//! Recordings in the laboratory: checking them by replay, and reading them back for learning.

pub mod dataset;
mod replay_observations;
pub mod verify;
