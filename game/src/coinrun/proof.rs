//! Proofs that a level of CoinRun can or cannot be won.

use crate::coinrun::{
    components::{Arena, ArenaBody, ArenaEntities, Crate, Enemy, PlayerBody, PlayerMemory, PlaysIn, Saw, Tiles},
    level::{Level, LevelParts, Spawn},
    planner::coin_is_unreachable,
    rules::Body,
    sim::Sim,
};
use bevy::prelude::*;
use bevy_playbot::episode::Episode;
use playbot_harness::detector::LevelProof;
use std::sync::Arc;

/// Proves a level unsolvable if [`coin_is_unreachable`] is true at its start: a search over more than the rules allow
/// has ended without the coin. Nothing is proved of other levels, since that search includes neither enemies nor time.
pub(super) fn prove(level: Arc<Level>) -> LevelProof {
    if !coin_is_unreachable(&Sim::new(level)) {
        return LevelProof::Unknown;
    }
    let why = "the coin cannot be reached: a search over all moves of the rules, with harmless enemies and \
               without a time limit, ended without it"
        .to_owned();
    LevelProof::Unsolvable { why }
}

/// Proves the same from the present state of a player of a World.
pub(super) fn prove_from(world: &World, agent: Entity) -> LevelProof {
    if !resumed(world, agent).is_some_and(|sim| coin_is_unreachable(&sim)) {
        return LevelProof::Unknown;
    }
    let why = "the coin cannot be reached any more: a search over all moves of the rules from the player's position, \
         with harmless enemies and without a time limit, ended without it"
        .to_owned();
    LevelProof::Unsolvable { why }
}

/// Returns the episode of a player as it goes on without an engine. `None` without a player, or if a body stands where
/// no level can have it.
fn resumed(world: &World, agent: Entity) -> Option<Sim> {
    let (player, memory) = (world.get::<PlayerBody>(agent)?.0, world.get::<PlayerMemory>(agent)?.0);
    let arena = world.get::<PlaysIn>(agent)?.0;
    let (level, tiles) = (&world.get::<Arena>(arena)?.level, &world.get::<Tiles>(arena)?.0);
    let (mut standing, mut enemies) = (Vec::new(), Vec::new());
    for entity in world.get::<ArenaEntities>(arena)?.iter() {
        let Some(body) = world.get::<ArenaBody>(entity).map(|body| body.0) else { continue };
        if world.get::<Enemy>(entity).is_some() {
            enemies.push(body);
        } else if world.get::<Saw>(entity).is_some() {
            standing.push(Spawn::Saw(cell_of(&body)?));
        } else if let Some(Crate { sprite }) = world.get::<Crate>(entity) {
            standing.push(Spawn::Crate { cell: cell_of(&body)?, sprite: *sprite });
        }
    }
    let steps = world.get::<Episode>(agent)?.tick;
    Some(Sim::resume(with_changes(level, tiles, standing), player, memory, enemies, steps))
}

/// Returns the level with the bodies that stand in it now, in case they were moved.
fn with_changes(level: &Arc<Level>, tiles: &crate::coinrun::TileGrid, standing: Vec<Spawn>) -> Arc<Level> {
    let is_enemy = |spawn: &Spawn| matches!(spawn, Spawn::Enemy { .. });
    let is_same = level.spawns.iter().filter(|spawn| !is_enemy(spawn)).eq(&standing);
    if is_same && *tiles == level.tiles {
        return Arc::clone(level);
    }
    let spawns = level.spawns.iter().copied().filter(is_enemy).chain(standing).collect();
    Arc::new(Level::new(LevelParts { tiles: tiles.clone(), spawns, ..level.parts().clone() }))
}

/// Returns the cell that a saw or a crate fills; `None` if it stands between cells.
fn cell_of(body: &Body) -> Option<[i32; 2]> {
    let cell = [body.x, body.y].map(|along| along.floor() as i32);
    (*body == Body::block(cell)).then_some(cell)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{Tile, components::build, generator::generate, level::Mode};

    #[test]
    fn generated_levels_are_not_called_unsolvable() {
        for seed in 0..50 {
            assert_eq!(prove(Arc::new(generate(Mode::Hard, seed))), LevelProof::Unknown, "{seed}");
        }
    }

    #[test]
    fn a_coin_behind_a_wall_that_is_too_high_is_out_of_reach() {
        let tower = "#...#.....#\n".repeat(29);
        let text = format!("#.........#\n{tower}#A..#....C#\n#=========#\n");
        let level = Level::from_text(&text).expect("a valid picture");
        assert!(prove(Arc::new(level)).why_unsolvable().is_some_and(|why| why.contains("coin")));
    }

    /// Returns a World in which a level is played, and the player.
    fn played(level: Level) -> (World, Entity) {
        let mut world = World::new();
        let arena = world.spawn_empty().id();
        let player = world.spawn((PlayerBody::default(), PlaysIn(arena), Episode::default())).id();
        build(&mut world.commands(), arena, player, Arc::new(level));
        world.flush();
        (world, player)
    }

    fn put(world: &mut World, player: Entity, x: f32) {
        if let Some(mut body) = world.get_mut::<PlayerBody>(player) {
            body.0.x = x;
        }
    }

    /// Returns a level with the coin beside the start, and a trap behind a tower.
    fn one_way() -> Level {
        let tower = "#...#.....#\n".repeat(29);
        Level::from_text(&format!("#.........#\n{tower}#AC.#.....#\n#=========#\n")).expect("a valid picture")
    }

    #[test]
    fn who_has_come_behind_the_tower_never_comes_back() {
        let (mut world, player) = played(one_way());
        assert_eq!(prove_from(&world, player), LevelProof::Unknown, "at the start");
        put(&mut world, player, 7.5);
        assert!(prove_from(&world, player).why_unsolvable().is_some_and(|why| why.contains("any more")));
        let no_player = world.spawn_empty().id();
        assert_eq!(prove_from(&world, no_player), LevelProof::Unknown);
    }

    #[test]
    fn what_somebody_has_changed_in_the_world_counts() {
        let (mut world, player) = played(one_way());
        put(&mut world, player, 7.5);
        let arena = world.get::<PlaysIn>(player).expect("it plays").0;
        if let Some(mut tiles) = world.get_mut::<Tiles>(arena) {
            (1..=3).for_each(|row| tiles.0.set(4, row, Tile::Empty));
        }
        assert_eq!(prove_from(&world, player), LevelProof::Unknown, "there is a hole in the tower");
    }

    #[test]
    fn a_generated_level_can_still_be_won_at_its_start() {
        for seed in 0..50 {
            let (world, player) = played(generate(Mode::Hard, seed));
            assert_eq!(prove_from(&world, player), LevelProof::Unknown, "{seed}");
        }
    }
}
