//! One tick of every arena, by the rules.

use crate::coinrun::{
    CoinRunEnd,
    components::{
        Arena, ArenaBody, ArenaEntities, Crate, Enemy, LastOutcome, PlayerBody, PlayerMemory, PlaysIn, Saw, Tiles,
    },
    paths::Surroundings,
    rules::{Body, COIN_REWARD, begin_step, hash_state, motion::touch, move_player, patrol},
};
use bevy::{ecs::system::SystemParam, prelude::*};
use playbot_harness::prelude::*;

/// The action that does nothing.
pub(crate) const NOTHING: u8 = 4;

/// All inhabitants of arenas, with their queries.
#[derive(SystemParam)]
pub(super) struct Arenas<'w, 's> {
    arenas: Query<'w, 's, (&'static Arena, &'static Tiles, &'static ArenaEntities)>,
    bodies: Query<'w, 's, (&'static mut ArenaBody, Has<Crate>, Has<Saw>, Has<Enemy>)>,
}

/// Bodies of one arena by kind, each in the order in which they were made. Reused from arena to arena.
#[derive(Default)]
pub(super) struct ArenaBodies {
    crates: Vec<Body>,
    saws: Vec<Body>,
    enemies: Vec<Body>,
    enemy_entities: Vec<Entity>,
}

impl Arenas<'_, '_> {
    fn gather(&self, arena: Entity, into: &mut ArenaBodies) -> Option<(&Arena, &Tiles)> {
        let (arena, tiles, entities) = self.arenas.get(arena).ok()?;
        into.crates.clear();
        into.saws.clear();
        into.enemies.clear();
        into.enemy_entities.clear();
        for entity in entities.iter() {
            match self.bodies.get(entity) {
                Ok((body, true, ..)) => into.crates.push(body.0),
                Ok((body, _, true, _)) => into.saws.push(body.0),
                Ok((body, .., true)) => {
                    into.enemies.push(body.0);
                    into.enemy_entities.push(entity);
                }
                _ => {}
            }
        }
        Some((arena, tiles))
    }

    fn write_enemies(&mut self, bodies: &ArenaBodies) {
        for (&entity, body) in bodies.enemy_entities.iter().zip(&bodies.enemies) {
            if let Ok((mut enemy, ..)) = self.bodies.get_mut(entity) {
                enemy.0 = *body;
            }
        }
    }
}

/// Moves enemies and player and applies contacts, in the order of the rules, for every arena whose agent plays.
pub(super) fn play(
    mut players: Query<(
        &Control,
        &Action,
        &PlaysIn,
        &mut Episode,
        &mut PlayerBody,
        &mut PlayerMemory,
        &mut Reward,
        &mut StateHash,
        &mut LastOutcome,
    )>,
    mut arenas: Arenas,
    mut bodies: Local<ArenaBodies>,
) {
    for (control, action, plays_in, mut episode, mut body, mut memory, mut reward, mut hash, mut last) in &mut players {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        let Some((arena, tiles)) = arenas.gather(plays_in.0, &mut bodies) else { continue };
        let (player, memory) = (&mut body.0, &mut memory.0);
        let ArenaBodies { crates, saws, enemies, .. } = &mut *bodies;
        let action = action.discrete().and_then(|index| u8::try_from(index).ok()).unwrap_or(NOTHING);
        let step = begin_step(player, memory, &tiles.0, action);
        for enemy in enemies.iter_mut() {
            patrol(enemy, memory, &step, &tiles.0, crates);
        }
        move_player(player, memory, &tiles.0, crates, &step, arena.level.x_wins_tie(episode.tick));
        let steps = episode.tick + 1;
        let outcome = touch(player, &tiles.0, saws.iter(), enemies.iter(), steps);
        hash.0 = hash_state(player, enemies.iter(), steps);
        last.0 = outcome;
        finish(outcome, &mut episode, &mut reward);
        arenas.write_enemies(&bodies);
    }
}

fn finish(outcome: Option<CoinRunEnd>, episode: &mut Episode, reward: &mut Reward) {
    match outcome {
        Some(CoinRunEnd::Timeout) => episode.truncate(),
        Some(outcome) => {
            if outcome.is_success() {
                reward.add(COIN_REWARD);
            }
            episode.terminate(outcome.is_success());
        }
        None => {}
    }
}

/// Fills the vector of every playing agent that reads one.
pub(super) fn observe(
    mut players: Query<(&Episode, &PlaysIn, &PlayerBody, &PlayerMemory, &mut Observation), With<VectorSensor>>,
    arenas: Arenas,
    mut bodies: Local<ArenaBodies>,
    mut surroundings: Local<Surroundings>,
) {
    for (episode, plays_in, body, memory, mut observation) in &mut players {
        if !episode.is_running() {
            continue;
        }
        let Some((arena, tiles)) = arenas.gather(plays_in.0, &mut bodies) else { continue };
        let scene = crate::coinrun::view::Scene {
            tiles: &tiles.0,
            player: &body.0,
            memory: memory.0,
            coin: arena.level.coin,
            crates: &bodies.crates,
            saws: &bodies.saws,
            enemies: &bodies.enemies,
        };
        scene.fill(&mut surroundings, &mut observation.vector);
    }
}

/// The tick of CoinRun, in `FixedUpdate`. Systems of your game go before or after it.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CoinRunSystems;
