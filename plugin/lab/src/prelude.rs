//! What a game needs that is trained and tested, and the prelude of [`bevy_playbot`].

pub use bevy_playbot::prelude::*;

pub use crate::{game::Game, sensors::GameSensors, split::LevelSplit};
