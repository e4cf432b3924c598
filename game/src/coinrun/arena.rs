//! Building a level as entities.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_playbot::fault::Faults;
use playbot_lab::prelude::*;

use super::{
    Level, PlayerState, Spawn,
    components::{
        Arena, ArenaBody, Coin, CoinRunMode, Crate, Enemy, InArena, PlayerBody, PlayerMemory, PlaysIn, Saw, Tiles,
    },
    generate,
    rules::Body,
};

/// Generates the level an episode asks for and puts it into the player's arena.
pub(super) fn start_episode(
    event: On<StartEpisode>,
    mode: Res<CoinRunMode>,
    players: Query<&PlaysIn>,
    mut faults: ResMut<Faults>,
    mut commands: Commands,
) {
    let Ok(plays_in) = players.get(event.entity) else { return };
    let Ok(seed) = u32::try_from(event.level) else {
        return faults.report(format!("level {} does not exist: CoinRun's seeds have 32 bits", event.level));
    };
    build(&mut commands, plays_in.0, event.entity, Arc::new(generate(mode.0, seed)));
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
