//! One tick of every arena, by the rules.

use bevy::{ecs::system::SystemParam, prelude::*};
use playbot_lab::prelude::*;

use super::{
    Outcome,
    components::{
        Arena, ArenaBody, Crate, Enemy, Inhabitants, LastOutcome, PlayerBody, PlayerMemory, PlaysIn, Saw, Tiles,
    },
    rules::{Body, COIN_REWARD, begin_step, hash_state, move_player, patrol, touch},
};

/// The action that does nothing.
pub const NOTHING: u8 = 4;

/// Everything that lives in arenas, and how to find it.
#[derive(SystemParam)]
pub(super) struct Arenas<'w, 's> {
    arenas: Query<'w, 's, (&'static Arena, &'static Tiles, &'static Inhabitants)>,
    bodies: Query<'w, 's, (&'static mut ArenaBody, Has<Crate>, Has<Saw>, Has<Enemy>)>,
}

/// Bodies of one arena by kind, each in the order in which they were made. Reused from arena to arena.
#[derive(Default)]
pub(super) struct Gathered {
    crates: Vec<Body>,
    saws: Vec<Body>,
    enemies: Vec<Body>,
    enemy_entities: Vec<Entity>,
}

impl Arenas<'_, '_> {
    fn gather(&self, arena: Entity, into: &mut Gathered) -> Option<(&Arena, &Tiles)> {
        let (arena, tiles, inhabitants) = self.arenas.get(arena).ok()?;
        into.crates.clear();
        into.saws.clear();
        into.enemies.clear();
        into.enemy_entities.clear();
        for entity in inhabitants.iter() {
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

    fn write_enemies(&mut self, gathered: &Gathered) {
        for (&entity, body) in gathered.enemy_entities.iter().zip(&gathered.enemies) {
            if let Ok((mut enemy, ..)) = self.bodies.get_mut(entity) {
                enemy.0 = *body;
            }
        }
    }
}

/// Enemies, player, touch, in the order of the rules, for every arena whose agent plays.
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
    mut gathered: Local<Gathered>,
) {
    for (control, action, plays_in, mut episode, mut body, mut memory, mut reward, mut hash, mut last) in &mut players {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        let Some((arena, tiles)) = arenas.gather(plays_in.0, &mut gathered) else { continue };
        let (player, memory) = (&mut body.0, &mut memory.0);
        let Gathered { crates, saws, enemies, .. } = &mut *gathered;
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
        arenas.write_enemies(&gathered);
    }
}

fn finish(outcome: Option<Outcome>, episode: &mut Episode, reward: &mut Reward) {
    match outcome {
        Some(Outcome::Timeout) => episode.truncate(),
        Some(outcome) => {
            if outcome.is_success() {
                reward.add(COIN_REWARD);
            }
            episode.terminate(outcome.is_success());
        }
        None => {}
    }
}

/// Fills the vector of every agent that plays and reads one.
pub(super) fn observe(
    mut players: Query<(&Episode, &PlaysIn, &PlayerBody, &PlayerMemory, &mut Observation), With<VectorSensor>>,
    arenas: Arenas,
    mut gathered: Local<Gathered>,
) {
    for (episode, plays_in, body, memory, mut observation) in &mut players {
        if !episode.is_running() {
            continue;
        }
        let Some((arena, tiles)) = arenas.gather(plays_in.0, &mut gathered) else { continue };
        let scene = super::view::Scene {
            tiles: &tiles.0,
            player: &body.0,
            memory: memory.0,
            coin: arena.level.coin,
            crates: &gathered.crates,
            saws: &gathered.saws,
            enemies: &gathered.enemies,
        };
        scene.fill(&mut observation.vector);
    }
}
