//! Building a level as entities.

use bevy::prelude::*;
use bevy_playbot::fault::Faults;
use playbot_lab::prelude::*;

use super::{
    components::{MazeArena, MazeBall, PlaysIn},
    levels::Levels,
    mode::Contact,
    physics::MazePhysics,
};

/// Every arena has a physics context, even if the contact is not rapier's.
#[derive(Resource, Clone, Copy, Debug, Reflect)]
#[reflect(Resource)]
pub(super) struct WithPhysics(pub bool);

/// Makes the level of an episode and puts it into the agent's arena.
pub(super) fn start_episode(
    event: On<StartEpisode>,
    levels: Levels,
    with_physics: Res<WithPhysics>,
    players: Query<(&Agent, &PlaysIn)>,
    mut faults: ResMut<Faults>,
    mut commands: Commands,
) {
    let Ok((agent, plays_in)) = players.get(event.entity) else { return };
    let (level, rules) = match levels.get(event.level) {
        Ok(found) => found,
        Err(error) => return faults.report(format!("agent {}, level {}: {error}", agent.index, event.level)),
    };
    let mut arena = commands.entity(plays_in.0);
    if rules.contact == Contact::Rapier {
        arena.insert(MazePhysics::solving(&level.walls, &level.start));
    } else if with_physics.0 {
        arena.insert(MazePhysics::following(&level.walls, &level.start));
    } else {
        // The last level may have come from a file with other rules.
        arena.remove::<MazePhysics>();
    }
    let ball = MazeBall(level.start);
    arena.insert(MazeArena { level, rules, player: event.entity });
    commands.entity(event.entity).insert(ball);
}
