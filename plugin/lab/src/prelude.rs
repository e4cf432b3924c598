//! What a game needs that is trained and tested, also in its own `cargo test`, and the prelude of [`bevy_playbot`].

pub use bevy_playbot::prelude::*;

pub use crate::{
    assertions::{
        LevelTest, assert_deterministic, assert_findings_gone, assert_levels_solvable, assert_levels_solved_by,
        assert_no_findings, assert_replays,
    },
    game::Game,
    sensors::GameSensors,
    split::LevelSplit,
};
