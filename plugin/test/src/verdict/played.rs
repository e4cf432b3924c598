//! Episodes to play, and their results.

use crate::verdict::{track::Track, walk::Walk};
use bevy::math::Vec2;
use bevy_playbot::episode::EpisodeResult;

/// An episode to play.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Task {
    /// The level.
    pub level: u64,
    /// Seed of the player's streams.
    pub seed: u64,
}

/// Result of an episode.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Played {
    /// Its end.
    pub end: PlayedEnd,
    /// True if the player drew no random number.
    pub exact: bool,
    /// The detectors' findings in it.
    pub found: Vec<EpisodeFinding>,
    /// Walk of its agent, if the game reports positions.
    pub walk: Option<Walk>,
    /// Progress of its agent.
    pub track: Track,
}

impl Played {
    /// Returns whether this detector has a finding in it, or the game broke this way.
    pub fn shows(&self, detector: &str) -> bool {
        let is_broken = matches!(&self.end, PlayedEnd::Broken { detector: how, .. } if *how == detector);
        is_broken || self.found.iter().any(|finding| finding.detector == detector)
    }
}

/// The end of an episode.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum PlayedEnd {
    /// An end by the game.
    Ended {
        /// The result.
        result: EpisodeResult,
        /// Last position of the agent, if the game reports it.
        position: Option<Vec2>,
        /// Cause of an end without the goal, if the game reports it.
        cause: Option<&'static str>,
    },
    /// The game broke.
    Broken {
        /// `panic`, `fault` or `endless`.
        detector: &'static str,
        /// Tick of the episode, if it had begun.
        tick: Option<u32>,
        /// The game's message.
        message: String,
    },
}

impl PlayedEnd {
    /// Returns the ticks of the episode, or those before the game broke.
    pub fn ticks(&self) -> u32 {
        match self {
            Self::Ended { result, .. } => result.ticks,
            Self::Broken { tick, .. } => tick.unwrap_or(0),
        }
    }
}

/// A detector's finding in an episode.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct EpisodeFinding {
    /// The detector.
    pub detector: &'static str,
    /// Tick of the episode.
    pub tick: u32,
    /// The message.
    pub message: String,
}
