//! Episodes that are saved in the middle: the bodies of an arena, by value.

use crate::coinrun::{
    CoinRun,
    components::{ArenaBody, ArenaEntities, LastOutcome, PlayerBody, PlayerMemory, PlaysIn, Tiles},
};
use bevy::prelude::*;
use playbot_harness::game::{Snapshot, SnapshotTools};

/// The state of an arena and its player between two ticks. Colliders follow the bodies, and are no part of it.
struct SavedArena {
    player: (PlayerBody, PlayerMemory, LastOutcome),
    tiles: Tiles,
    /// In creation order, which is the same for all arenas of a level.
    bodies: Vec<ArenaBody>,
}

impl SnapshotTools for CoinRun {
    fn save(&self, world: &World, agent: Entity) -> Option<Snapshot> {
        let arena = world.get::<PlaysIn>(agent)?.0;
        let entities = world.get::<ArenaEntities>(arena)?;
        let bodies = entities.iter().map(|entity| world.get::<ArenaBody>(entity).copied());
        Some(Snapshot::new(SavedArena {
            player: (*world.get(agent)?, *world.get(agent)?, *world.get(agent)?),
            tiles: world.get::<Tiles>(arena)?.clone(),
            bodies: bodies.collect::<Option<_>>()?,
        }))
    }

    fn load(&self, world: &mut World, agent: Entity, snapshot: &Snapshot) -> bool {
        let Some(saved) = snapshot.get::<SavedArena>() else { return false };
        let Some(arena) = world.get::<PlaysIn>(agent).map(|plays_in| plays_in.0) else { return false };
        let entities: Vec<Entity> =
            world.get::<ArenaEntities>(arena).map_or_else(Vec::new, |entities| entities.iter().collect());
        // No level is built yet, or a game on top has added bodies.
        if entities.len() != saved.bodies.len() {
            return false;
        }
        for (entity, body) in entities.into_iter().zip(&saved.bodies) {
            world.entity_mut(entity).insert(*body);
        }
        // Pictures draw tiles again if they are changed.
        if let Some(mut tiles) = world.get_mut::<Tiles>(arena)
            && *tiles != saved.tiles
        {
            tiles.clone_from(&saved.tiles);
        }
        world.entity_mut(agent).insert(saved.player);
        true
    }
}
