//! The traits of a detector.

use bevy_playbot::episode::EpisodeResult;

use super::{
    moment::{Moment, WorldMoment},
    setting::Setting,
};
use crate::floor_plan::FloorPlan;

/// A search for one kind of defect in every episode of a test.
///
/// Findings must depend on the episode alone, not on the clock and not on earlier episodes. Then results are the same
/// on any number of threads and shards.
pub trait Detector: Send + Sync {
    /// Returns its name, in small letters and hyphens, as findings and the command line have it.
    fn name(&self) -> &'static str;

    /// Returns the defect that it finds, in one line.
    fn describe(&self) -> &'static str;

    /// Returns whether it is a default detector: cheap, and without false alarms in an unmutated game.
    fn is_usual(&self) -> bool {
        true
    }

    /// Returns its settings, which may be changed before the test starts.
    fn settings(&mut self) -> Vec<Setting<'_>> {
        Vec::new()
    }

    /// Starts to watch an episode; `None` if there is nothing to watch.
    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn Watch>> {
        None
    }

    /// Starts to watch a World; `None` if it watches agents only.
    fn watch_world(&self) -> Option<Box<dyn WorldWatch>> {
        None
    }
}

/// The level of an episode that starts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelAhead {
    /// Number of the level.
    pub level: u64,
    /// The level from above, if the game has such plans.
    pub plan: Option<FloorPlan>,
}

/// A detector's view of one agent during one episode.
pub trait Watch {
    /// Examines the tick that was just played, the last one included. Returns a message if something is wrong: the
    /// finding of this tick, and the only one of the episode.
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String>;

    /// Examines the end of the episode, after its last tick.
    fn end(&mut self, _moment: &Moment<'_>, _result: &EpisodeResult) -> Option<String> {
        None
    }
}

/// A detector's view of a World after each of its ticks.
///
/// If it finds something while several agents play there, their episodes are replayed, each alone in a World of its
/// own, to see whose finding it is.
pub trait WorldWatch {
    /// Returns whether it reads the errors of the log.
    fn hears_errors(&self) -> bool {
        false
    }

    /// Returns a message if something is wrong.
    fn tick(&mut self, moment: &WorldMoment<'_>) -> Option<String>;
}
