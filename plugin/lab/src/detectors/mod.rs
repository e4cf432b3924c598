//! Detectors that every game has: each looks for one kind of defect while testers play, or in the levels that they played.
//!
//! [`Detectors`] are those of a test. Some are usual: they cost little and give no false alarm in a sound game. Others are
//! chosen by name, and all have settings; [`list`] says which there are. A game adds its own with
//! [`Game::detectors`](crate::game::Game::detectors), see [`detector`](crate::detector).

mod blank_picture;
mod catalogue;
mod determinism;
mod ear;
mod efforts;
mod entity_leak;
mod error_log;
mod explosion;
mod fell_through;
mod frozen;
mod level_detector;
mod out_of_bounds;
mod probe;
mod reward_farm;
mod reward_loop;
mod runaway;
mod selection;
mod shortcut;
mod stuck;
#[cfg(test)]
mod testing;
mod tick_time;
mod unreachable_region;

pub use catalogue::{ALWAYS, DetectorInfo, list};
pub(crate) use ear::Ear;
pub use level_detector::{LevelDefect, LevelDetector, TestedBy, TestedLevel};
pub use selection::{DetectorChoice, DetectorError, Detectors};
pub use tick_time::{SlowTick, TIMING, TickTime, forget_timing};
