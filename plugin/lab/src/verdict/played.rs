//! Episodes to be played, and what came of them.

use bevy::prelude::*;
use bevy_playbot::episode::EpisodeResult;

use super::walk::Walk;
use crate::detectors::Detectors;

/// An episode to be played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Task {
    /// The level.
    pub level: u64,
    /// Seed of the player's streams.
    pub seed: u64,
}

/// What came of an episode.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Played {
    /// How it ended.
    pub end: PlayedEnd,
    /// Whether the player drew no random number.
    pub exact: bool,
    /// What detectors found in it.
    pub found: Vec<EpisodeFinding>,
    /// Where its agent went, if the game says.
    pub walk: Option<Walk>,
}

impl Played {
    /// Whether this detector found something in it, or the game broke so.
    pub fn shows(&self, detector: &str) -> bool {
        let is_broken = matches!(&self.end, PlayedEnd::Broken { detector: how, .. } if *how == detector);
        is_broken || self.found.iter().any(|finding| finding.detector == detector)
    }
}

/// What a detector found in an episode.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct EpisodeFinding {
    /// The detector.
    pub detector: &'static str,
    /// Tick of the episode.
    pub tick: u32,
    /// What is wrong.
    pub message: String,
}

/// How an episode ended.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum PlayedEnd {
    /// As the game says.
    Ended {
        /// What came of it.
        result: EpisodeResult,
        /// Where the agent was then, if the game says.
        place: Option<Vec2>,
        /// Why it ended without the aim, if the game says.
        cause: Option<&'static str>,
    },
    /// The game broke.
    Broken {
        /// `panic`, `fault` or `endless`.
        detector: &'static str,
        /// Tick of the episode, if it had begun.
        tick: Option<u32>,
        /// What the game said.
        message: String,
    },
}

/// Why the episodes of a World could not all be played.
pub(super) enum Interruption {
    /// Somebody asked to stop.
    Stopped,
    /// The World cannot go on.
    Broken {
        /// What is wrong.
        detector: &'static str,
        /// What the game said.
        message: String,
    },
}

/// How it is watched while it is played.
pub(super) struct Watch<'a> {
    /// Hears how many episodes have been finished.
    pub progress: &'a (dyn Fn(u64) + Sync),
    /// Whether to stop.
    pub stop: &'a (dyn Fn() -> bool + Sync),
    /// What looks for defects.
    pub detectors: &'a Detectors,
    /// Mode of the levels.
    pub mode: &'a str,
    /// Name of who plays.
    pub tester: &'a str,
    /// Most arenas of a World. It changes no result of a game that keeps nothing from one episode to the next.
    pub arenas: usize,
}
