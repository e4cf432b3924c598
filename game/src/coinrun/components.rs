//! The game as entities: an arena, its player and what lives in it.
//!
//! Every arena is an entity with its [`Tiles`]. The player and all saws, enemies, crates and the coin are entities with
//! a [`PlayerBody`] or an [`ArenaBody`]; the rules read them anew in each tick, so that a game built
//! on top may add, move or remove them.

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

/// The arena something is in, the player excepted: it stays when the level changes.
#[derive(Component, Debug, Reflect)]
#[reflect(Component)]
#[relationship(relationship_target = ArenaEntities)]
pub struct InArena(pub Entity);

/// Everything in an arena that goes with its level, in the order in which it was made.
#[derive(Component, Debug, Default, Reflect)]
#[reflect(Component)]
#[relationship_target(relationship = InArena, linked_spawn)]
pub struct ArenaEntities(Vec<Entity>);

/// The agent's body and what it remembers between steps. Belongs to the entity with the
/// [`Agent`](bevy_playbot::agent::Agent).
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
    /// Which of the 9 pictures it has.
    pub sprite: u8,
}

/// Carries a player who falls onto it, and lets everything else pass.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
#[require(ArenaBody)]
pub struct Crate {
    /// Which of the 4 pictures it has.
    pub sprite: u8,
}

/// The goal. The rules look at its tile; the entity is there to be seen and sensed.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
#[require(ArenaBody)]
pub struct Coin;

/// Why the last episode of this player ended.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct LastOutcome(pub Option<super::Outcome>);
