//! Faults of a single episode of a recording, and their messages.

use thiserror::Error;

/// The fault of an episode.
///
/// `step` counts the ticks of the episode from 0.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum EpisodeFault {
    /// Two per-tick lists have different lengths.
    #[error("{found} {what} for {steps} steps (expected {expected})")]
    Length {
        /// Name of the list.
        what: &'static str,
        /// Entries found.
        found: usize,
        /// Entries expected.
        expected: usize,
        /// Steps of the episode: the number of its state hashes.
        steps: usize,
    },
    /// Discrete actions in a file of continuous ones, or another number of dimensions.
    #[error("the actions are {found}, but the header says {expected}")]
    ActionKind {
        /// Kind of the episode's actions.
        found: String,
        /// Kind of the header's actions.
        expected: String,
    },
    /// A discrete action the game does not have.
    #[error("action {action} at step {step} is out of range: the game has actions 0 to {}", count.saturating_sub(1))]
    ActionRange {
        /// The step.
        step: usize,
        /// The action.
        action: u32,
        /// Number of actions of the game.
        count: usize,
    },
    /// A value that is not a finite number.
    #[error("{what} at step {step} is {value}, not a finite number")]
    NotFinite {
        /// Name of the list.
        what: &'static str,
        /// The step.
        step: usize,
        /// The value: NaN or an infinity.
        value: f32,
    },
    /// The episode is too long for one frame.
    #[error("the episode takes {bytes} bytes, but a frame holds at most {limit}")]
    TooLarge {
        /// Size of the episode on disk.
        bytes: usize,
        /// Largest size of a frame.
        limit: usize,
    },
    /// The bytes of the frame contradict each other.
    #[error("malformed frame: {0}")]
    Malformed(String),
}
