//! The game as entities: an arena, its player and its inhabitants.
//!
//! Every arena is an entity with its [`Tiles`]. The player and all saws, enemies, crates and the coin are entities with
//! a [`PlayerBody`] or an [`ArenaBody`]. The rules read them anew in each tick, so a game built on top may add, move or
//! remove them.

use std::sync::Arc;

use bevy::prelude::*;

use super::{Level, Mode, PlayerState, TileGrid, rules::Body};

/// Mode in which levels are generated.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug, PartialEq)]
pub struct CoinRunMode(pub Mode);

/// One running copy of a level.
#[derive(Component, Debug, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
#[require(ArenaEntities)]
pub struct Arena {
    /// The level as it was generated.
    #[reflect(ignore)]
    pub level: Arc<Level>,
    /// Its player.
    pub player: Entity,
}

/// The ground, the lava and the coin of an arena.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct Tiles(pub TileGrid);

/// The arena of an entity of its level. Players are not marked: they stay when the level changes.
#[derive(Component, Debug, Reflect)]
#[reflect(Component)]
#[relationship(relationship_target = ArenaEntities)]
pub struct InArena(pub Entity);

/// All entities of an arena's level, in creation order.
#[derive(Component, Debug, Default, Reflect)]
#[reflect(Component)]
#[relationship_target(relationship = InArena, linked_spawn)]
pub struct ArenaEntities(Vec<Entity>);

/// The agent's body and its memory between steps. Belongs to the entity with the [`Agent`](bevy_playbot::agent::Agent).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
#[require(PlayerMemory)]
pub struct PlayerBody(pub Body);

/// Support and facing of the player.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct PlayerMemory(pub PlayerState);

/// The arena of a player.
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub struct PlaysIn(pub Entity);

/// Position, velocity and size of something in an arena.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct ArenaBody(pub Body);

/// Kills on touch and stands still.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
#[require(ArenaBody)]
pub struct Saw;

/// Kills on touch and walks to and fro.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
#[require(ArenaBody)]
pub struct Enemy {
    /// Its picture, 0 to 8.
    pub sprite: u8,
}

/// Carries a player who falls onto it, and lets everything else pass.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
#[require(ArenaBody)]
pub struct Crate {
    /// Its picture, 0 to 3.
    pub sprite: u8,
}

/// The goal. The rules look at its tile; the entity is only drawn and sensed.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
#[require(ArenaBody)]
pub struct Coin;

/// The outcome of this player's last episode.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct LastOutcome(pub Option<super::Outcome>);
