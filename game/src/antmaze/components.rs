//! The game as entities: an agent with its ant, and the arena it is drawn in.

use std::sync::Arc;

use bevy::prelude::*;

use super::{level::AntMazeLevel, mode::AntMazeMode};
use crate::ant::{AntBody, AntState, steering::AntComponent};

/// Mode of the generated levels.
#[derive(Resource, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug, PartialEq)]
pub struct AntMazeRules(pub AntMazeMode);

/// The level of an agent, inserted with its first episode.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct InMaze(pub Arc<AntMazeLevel>);

/// An agent's ant with the floor and the walls around it: a physics world of its own. Inserted with the first episode.
#[derive(Component, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
pub struct MazeAnt(pub AntBody);

impl AntComponent for MazeAnt {
    fn state(&self) -> AntState {
        self.0.state()
    }
}

/// The arena of an agent: the drawings around it belong to this entity.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub struct PlaysIn(pub Entity);
