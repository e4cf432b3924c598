//! Building a level as entities.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_playbot::fault::Faults;
use playbot_lab::prelude::*;

use super::{
    components::{InMaze, MazeAnt, PlaysIn},
    level::AntMazeLevel,
    levels::Levels,
    walls::wall_boxes,
};
use crate::ant::AntBody;

/// Makes the level of an episode and puts the agent's ant into it.
pub(super) fn start_episode(
    event: On<StartEpisode>,
    levels: Levels,
    agents: Query<&Agent, With<PlaysIn>>,
    mut faults: ResMut<Faults>,
    mut commands: Commands,
) {
    let Ok(agent) = agents.get(event.entity) else { return };
    match levels.get(event.level) {
        Ok(level) => build(&mut commands, event.entity, level),
        Err(error) => {
            faults.report(format!("agent {}, level {}: {error}", agent.index, event.level));
            commands.entity(event.entity).insert(Control::Idle);
        }
    }
}

/// Puts an agent with a new ant into a level. The physics begins anew with every episode, so earlier episodes change
/// nothing, not even the order in which contacts are solved.
fn build(commands: &mut Commands, agent: Entity, level: Arc<AntMazeLevel>) {
    let mut body = AntBody::new(&wall_boxes(&level.maze));
    body.set_state(&level.reset);
    commands.entity(agent).insert((MazeAnt(body), InMaze(level)));
}
