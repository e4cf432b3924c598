//! The items that the bots and tests of a game need, in one import.

pub use bevy_playbot::episode::EpisodeEnd;
pub use bevy_playbot::virtual_input::PointerPosition;
pub use playbot_harness::floor_plan::FloorPlan;
pub use playbot_harness::foreign::{ForeignGame, LevelFromFile, LevelSeed, PlayedAgent, PlayedMode, Restart};
pub use playbot_harness::prelude::*;
pub use playbot_test::assertions::LevelTest;
