//! Building a level as entities.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_playbot::fault::Faults;
use playbot_lab::prelude::*;

use super::{
    Level, PlayerState, Spawn,
    components::{Arena, ArenaBody, Coin, Crate, Enemy, InArena, PlayerBody, PlayerMemory, PlaysIn, Saw, Tiles},
    levels::Levels,
    rules::Body,
};

/// Makes the level of an episode, or takes the one of a file, and puts it into the player's arena.
pub(super) fn start_episode(
    event: On<StartEpisode>,
    levels: Levels,
    players: Query<&PlaysIn>,
    mut faults: ResMut<Faults>,
    mut commands: Commands,
) {
    let Ok(plays_in) = players.get(event.entity) else { return };
    match levels.get(event.level) {
        Ok(level) => build(&mut commands, plays_in.0, event.entity, level),
        Err(why) => faults.report(why),
    }
}

/// Replaces whatever is in the arena by this level, with the player at its start.
pub fn build(commands: &mut Commands, arena: Entity, player: Entity, level: Arc<Level>) {
    commands.entity(player).insert((PlayerBody(Body::player()), PlayerMemory(PlayerState::default())));
    commands.entity(arena).despawn_related::<super::components::ArenaEntities>();
    for spawn in &level.spawns {
        match *spawn {
            Spawn::Saw(cell) => commands.spawn((Saw, ArenaBody(Body::block(cell)), InArena(arena))),
            Spawn::Enemy { cell, dir, sprite } => {
                commands.spawn((Enemy { sprite }, ArenaBody(Body::enemy(cell, dir)), InArena(arena)))
            }
            Spawn::Crate { cell, sprite } => {
                commands.spawn((Crate { sprite }, ArenaBody(Body::block(cell)), InArena(arena)))
            }
        };
    }
    commands.spawn((Coin, ArenaBody(Body::block(level.coin)), InArena(arena)));
    commands.entity(arena).insert((Tiles(level.tiles.clone()), Arena { level, player }));
}
