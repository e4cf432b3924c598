//! Detectors that every game has: each looks for one kind of defect while testers play, or in the levels after play.
//!
//! [`Detectors`] are those of a test. Default detectors cost little and give no false alarm in an unmutated game.
//! Opt-in detectors are named with `--detect`. All have settings, and [`list`] describes them. A game adds its own with
//! [`TestTools::detectors`](crate::game::TestTools::detectors), see [`detector`](crate::detector).

mod blank_picture;
mod catalogue;
mod clock_end;
mod dead_action;
mod determinism;
mod ear;
mod efforts;
mod entity_leak;
mod error_log;
mod explosion;
mod far_goal;
mod fell_through;
mod frozen;
mod game_proofs;
mod goal_ignored;
mod level_detector;
mod out_of_bounds;
mod par;
mod probe;
mod reward_farm;
mod reward_loop;
mod runaway;
mod script;
mod selection;
mod short_time;
mod shortcut;
mod soft_lock;
mod solid_tiles;
mod stuck;
#[cfg(test)]
mod testing;
mod through_wall;
mod tick_time;
mod too_long;
mod uneven_time;
mod unreachable_region;

pub use catalogue::{ALWAYS, DetectorInfo, list};
pub(crate) use catalogue::{compares_testers, own_detectors};
pub(crate) use ear::Ear;
pub use far_goal::FarGoal;
pub(crate) use game_proofs::GameProofs;
pub use goal_ignored::GoalIgnored;
pub use level_detector::{LevelDefect, LevelDetector, ShownBy, TestedBy, TestedLevel};
pub use par::{ParError, Pars};
pub use selection::{DetectorChoice, DetectorError, Detectors};
pub use through_wall::ThroughWall;
pub use tick_time::{SlowTick, TIMING, TickTime, forget_timing};
