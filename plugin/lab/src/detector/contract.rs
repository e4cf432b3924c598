//! What a detector is.

use bevy_playbot::episode::EpisodeResult;

use super::{
    moment::{Moment, WorldMoment},
    setting::Setting,
};
use crate::floor_plan::FloorPlan;

/// Looks for one kind of defect in every episode of a test.
///
/// What it finds must depend on the episode alone, neither on the clock nor on what was played before it: then results are
/// the same on any number of threads and shards.
pub trait Detector: Send + Sync {
    /// Its name, in small letters and hyphens, as findings and the command line have it.
    fn name(&self) -> &'static str;

    /// What it finds, in one line.
    fn describe(&self) -> &'static str;

    /// Whether it looks where nobody chooses: it costs little and gives no false alarm in a sound game.
    fn is_usual(&self) -> bool {
        true
    }

    /// Its settings, which may be changed before the test begins.
    fn settings(&mut self) -> Vec<Setting<'_>> {
        Vec::new()
    }

    /// Begins to look at an episode; `None` if there is nothing to look at.
    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn Watch>> {
        None
    }

    /// Begins to look at a World; `None` if agents are all that is looked at.
    fn watch_world(&self) -> Option<Box<dyn WorldWatch>> {
        None
    }
}

/// The level of an episode that begins.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelAhead {
    /// Number of the level.
    pub level: u64,
    /// The level from above, if the game has such plans.
    pub plan: Option<FloorPlan>,
}

/// Looks at one agent during one episode.
pub trait Watch {
    /// Looks at the tick that was just played, the last one included. What is wrong, if anything: it is the finding of this
    /// tick, and the only one of the episode.
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String>;

    /// Looks at the end of the episode, after its last tick.
    fn end(&mut self, _moment: &Moment<'_>, _result: &EpisodeResult) -> Option<String> {
        None
    }
}

/// Looks at a World after each of its ticks.
///
/// If it finds something while several agents play there, their episodes are played again, each alone in a World of its own,
/// to see whose it is.
pub trait WorldWatch {
    /// Whether it wants to hear what is logged as an error.
    fn hears_errors(&self) -> bool {
        false
    }

    /// What is wrong, if anything.
    fn tick(&mut self, moment: &WorldMoment<'_>) -> Option<String>;
}
