//! The game as entities: an arena, its player and its inhabitants.
//!
//! Every arena is an entity with its [`Tiles`]. The player and all saws, enemies, crates and the coin are entities with
//! a [`PlayerBody`] or an [`ArenaBody`]. The rules read them anew in each tick, so a game built on top may add, move or
//! remove them.

use crate::coinrun::{Level, Mode, PlayerState, Spawn, TileGrid, generator::generate, rules::Body};
use bevy::{ecs::system::SystemParam, prelude::*};
use bevy_playbot::fault::Faults;
use playbot_harness::{
    game::{Game, level_designs},
    level_files::{LevelDesigns, is_level_files},
    prelude::*,
};
use std::sync::Arc;

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

/// The agent's body and its memory between steps. Belongs to the entity with the [`Agent`].
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
pub struct LastOutcome(pub Option<crate::coinrun::CoinRunEnd>);

// The building of a level as entities.

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
    commands.entity(arena).despawn_related::<ArenaEntities>();
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

// Creation order of the bodies of a level, as text.
//
// Files list saws, crates and enemies apart. The creation order of all of them decides which of two overlapping bodies
// is in front.

fn letter(spawn: &Spawn) -> char {
    match spawn {
        Spawn::Saw(_) => 's',
        Spawn::Crate { .. } => 'c',
        Spawn::Enemy { .. } => 'e',
    }
}

/// Returns a letter for each body: `s`, `c` or `e`. `None` for all saws before all crates before all enemies.
pub(super) fn to_text(spawns: &[Spawn]) -> Option<String> {
    let order: String = spawns.iter().map(letter).collect();
    let kinds = ["s", "c", "e"].map(|kind| kind.repeat(order.matches(kind).count()));
    (order != kinds.concat()).then_some(order)
}

/// Arranges the bodies in the order of the letters; `None` unless there is one letter for each body. Bodies of one kind
/// stay in their order.
pub(super) fn arrange(order: &str, spawns: &[Spawn]) -> Option<Vec<Spawn>> {
    let mut kinds = ['s', 'c', 'e'].map(|kind| (kind, spawns.iter().filter(move |spawn| letter(spawn) == kind)));
    let mut arranged = Vec::with_capacity(spawns.len());
    for wanted in order.chars() {
        let (_, bodies) = kinds.iter_mut().find(|(kind, _)| *kind == wanted)?;
        arranged.push(*bodies.next()?);
    }
    (arranged.len() == spawns.len()).then_some(arranged)
}

// Levels of a mode, from a seed or from a file.

/// The levels of a World.
#[derive(SystemParam)]
pub(super) struct Levels<'w> {
    mode: Res<'w, CoinRunMode>,
    designs: Option<Res<'w, LevelDesigns>>,
}

impl Levels<'_> {
    /// Returns a level, or an explanation why there is none.
    pub fn get(&self, level: u64) -> Result<Arc<Level>, String> {
        match &self.designs {
            Some(designs) => designs.get(level),
            None => generated(self.mode.0, level),
        }
    }
}

/// Returns a level of a mode that has been checked, or an explanation why there is none.
pub(super) fn level_of(game: &dyn Game, mode: &str, level: u64) -> Result<Arc<Level>, String> {
    if is_level_files(mode) {
        let designs = level_designs(game, mode);
        return designs.map_err(|error| error.to_string())?.get(level);
    }
    generated(mode.parse().map_err(|error: crate::coinrun::level::UnknownMode| error.to_string())?, level)
}

fn generated(mode: crate::coinrun::Mode, level: u64) -> Result<Arc<Level>, String> {
    match u32::try_from(level) {
        Ok(seed) => Ok(Arc::new(generate(mode, seed))),
        Err(_) => {
            Err(format!("level {level} does not exist: CoinRun's seeds have 32 bits, choose one up to {}", u32::MAX))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_come_back_in_the_order_in_which_they_were() {
        let (saw, other) = (Spawn::Saw([1, 1]), Spawn::Saw([2, 1]));
        let wooden = Spawn::Crate { cell: [1, 1], sprite: 2 };
        let enemy = Spawn::Enemy { cell: [3, 1], dir: 1, sprite: 0 };
        let mixed = [saw, enemy, wooden, other];
        let listed = [saw, other, wooden, enemy];
        assert_eq!((to_text(&mixed).as_deref(), to_text(&listed)), (Some("secs"), None));
        assert_eq!(arrange("secs", &listed).as_deref(), Some(&mixed[..]));
        for bad in ["", "sec", "secss", "seccs", "secx"] {
            assert_eq!(arrange(bad, &listed), None, "{bad}");
        }
    }
}
