//! The checks that reproduce a finding.

use std::sync::Arc;

use super::{head::FindingHead, moment::Watcher, play::Replayed};
use crate::{
    detector::Detector,
    detectors::{LevelDetector, ShownBy},
    game::Game,
};

/// The check that reproduces a detector's findings.
#[derive(Clone)]
pub enum Check {
    /// Examines the level, without play. Returns whether the finding of this mode and level is there.
    Level(fn(&dyn Game, &str, u64) -> bool),
    /// Examines the result of the episode. Returns the tick of the finding, if it is there.
    Episode(fn(&FindingHead, &Replayed) -> Option<u32>),
    /// Watches the World tick by tick; each replay gets a watcher of its own.
    Ticks(Arc<dyn Fn(&FindingHead) -> Watcher + Send + Sync>),
    /// Runs a detector during play. The message is then the new one.
    Detector(Arc<dyn Detector>),
    /// Runs a detector of whole levels: on the level, or on the result of the episode, as it
    /// [declares](LevelDetector::shown_by).
    WholeLevel(Arc<dyn LevelDetector>),
}

impl Check {
    /// Returns whether the check needs a replay.
    pub fn needs_play(&self) -> bool {
        match self {
            Self::Level(_) => false,
            Self::Episode(_) | Self::Ticks(_) | Self::Detector(_) => true,
            Self::WholeLevel(detector) => detector.shown_by() == ShownBy::Episode,
        }
    }
}
