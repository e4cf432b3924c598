//! How it is found out whether a finding is still there.

use std::sync::Arc;

use super::{head::FindingHead, moment::Watcher, play::Replayed};
use crate::{
    detector::Detector,
    detectors::{LevelDetector, ShownBy},
    game::Game,
};

/// How a detector's findings are looked for again.
#[derive(Clone)]
pub enum Check {
    /// In the level itself: nobody has to play. Asks whether the finding of this mode and level is there.
    Level(fn(&dyn Game, &str, u64) -> bool),
    /// In what came of the episode: the tick of the finding, if it is there.
    Episode(fn(&FindingHead, &Replayed) -> Option<u32>),
    /// In the World, tick by tick; each replay gets a watcher of its own.
    Ticks(Arc<dyn Fn(&FindingHead) -> Watcher + Send + Sync>),
    /// By a detector that looks while somebody plays. It says anew what is wrong.
    Detector(Arc<dyn Detector>),
    /// By a detector that looks at whole levels: in the level itself, or in what came of the episode, as it
    /// [says](LevelDetector::shown_by).
    WholeLevel(Arc<dyn LevelDetector>),
}

impl Check {
    /// Whether somebody has to play.
    pub fn needs_play(&self) -> bool {
        match self {
            Self::Level(_) => false,
            Self::Episode(_) | Self::Ticks(_) | Self::Detector(_) => true,
            Self::WholeLevel(detector) => detector.shown_by() == ShownBy::Episode,
        }
    }
}
