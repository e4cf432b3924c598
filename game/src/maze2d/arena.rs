//! Building a level as entities.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_playbot::fault::Faults;
use playbot_lab::prelude::*;

use super::{
    components::{Maze2dRules, MazeArena, MazeBall, PlaysIn},
    level::Maze2dLevel,
    mode::Contact,
    physics::MazePhysics,
};

/// Whether every arena has a physics context, even if the contact is not rapier's.
#[derive(Resource, Clone, Copy, Debug, Reflect)]
#[reflect(Resource)]
pub(super) struct WithPhysics(pub bool);

/// Makes the level that an episode asks for and puts it into the agent's arena.
pub(super) fn start_episode(
    event: On<StartEpisode>,
    rules: Res<Maze2dRules>,
    with_physics: Res<WithPhysics>,
    players: Query<(&Agent, &PlaysIn)>,
    mut faults: ResMut<Faults>,
    mut commands: Commands,
) {
    let Ok((agent, plays_in)) = players.get(event.entity) else { return };
    let level = match Maze2dLevel::new(&rules.0, event.level) {
        Ok(level) => Arc::new(level),
        Err(error) => return faults.report(format!("agent {}, level {}: {error}", agent.index, event.level)),
    };
    let mut arena = commands.entity(plays_in.0);
    if rules.0.contact == Contact::Rapier {
        arena.insert(MazePhysics::solving(&level.walls, &level.start));
    } else if with_physics.0 {
        arena.insert(MazePhysics::following(&level.walls, &level.start));
    }
    let ball = MazeBall(level.start);
    arena.insert(MazeArena { level, player: event.entity });
    commands.entity(event.entity).insert(ball);
}
