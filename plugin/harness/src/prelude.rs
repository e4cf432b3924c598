//! The items that a trained and tested game needs, also in its own `cargo test`, and the prelude of [`bevy_playbot`].

pub use crate::{
    game::{Game, GameTools},
    sensors::GameSensors,
    split::LevelSplit,
};
pub use bevy_playbot::prelude::*;
