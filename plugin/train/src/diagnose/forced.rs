//! Forced actions: what each action changes, against doing nothing, in copies of a World.

use crate::diagnose::play::PlayedEpisode;
use bevy_playbot::{
    action::{Action, ActionValue},
    agent::Control,
    engine::tick_world,
    fault::Fault,
    level::LevelQueue,
    observation::Observation,
    reward::Reward,
    state_hash::StateHash,
};
use playbot_harness::{
    game::{Game, idle_action},
    single_actions::{SingleAction, single_actions},
    worlds::{build_world, hash_with_agent},
};

/// Moments of an episode in which actions are tried, and ticks for which each is held.
const MOMENTS: usize = 3;
const HELD: usize = 10;

/// Longest beginning of an episode that is played for a moment, ticks.
const LATEST: usize = 120;

/// An action that was forced.
#[derive(Clone, Debug, PartialEq)]
pub struct ForcedAction {
    /// Its name.
    pub name: String,
    /// The number of a discrete action, or its place among the options of all choices and then the numbers.
    pub number: u32,
    /// Moments in which it was tried.
    pub tried: usize,
    /// Moments in which it changed something.
    pub effects: usize,
}

impl ForcedAction {
    /// Returns whether it was tried in several moments and never changed anything.
    pub fn is_dead(&self) -> bool {
        self.tried >= 2 && self.effects == 0
    }
}

/// Tries every action but the idle ones, from a few moments of an episode on, unless it has an effect in `forced` already,
/// and adds the results there. A continuous value is tried far up and far down.
///
/// # Errors
///
/// The game broke its contract.
pub fn force(
    game: &dyn Game,
    mode: &str,
    episode: &PlayedEpisode,
    forced: &mut Vec<ForcedAction>,
) -> Result<(), Fault> {
    let (idle, candidates) = (idle_action(game), candidates(game));
    if forced.is_empty() {
        let untried = |(name, number, _): &(String, u32, _)| ForcedAction {
            name: name.clone(),
            number: *number,
            tried: 0,
            effects: 0,
        };
        forced.extend(candidates.iter().map(untried));
    }
    if forced.iter().all(|action| action.effects > 0) {
        return Ok(());
    }
    let length = episode.actions.len().min(LATEST);
    let mut moments: Vec<usize> = (0..MOMENTS).map(|moment| length * moment / MOMENTS).collect();
    moments.dedup();
    for moment in moments {
        let before = &episode.actions[..moment];
        let nothing = held(game, mode, episode.level, before, &idle)?;
        for (action, (.., ways)) in forced.iter_mut().zip(&candidates).filter(|(action, _)| action.effects == 0) {
            // A masked action would not be played.
            let mask = episode.masks.get(moment);
            let is_legal = mask.is_none_or(|mask| mask.get(action.number as usize).copied().unwrap_or(true));
            if !is_legal {
                continue;
            }
            action.tried += 1;
            for way in ways {
                if held(game, mode, episode.level, before, way)? != nothing {
                    action.effects += 1;
                    break;
                }
            }
        }
    }
    Ok(())
}

/// Returns the actions to try: name, number, and the ways to take each.
fn candidates(game: &dyn Game) -> Vec<(String, u32, Vec<ActionValue>)> {
    let doing = single_actions(game).into_iter().filter(|single| !single.is_idle);
    let named =
        |SingleAction { name, number, ways, .. }| (name.unwrap_or_else(|| format!("action {number}")), number, ways);
    doing.map(named).collect()
}

/// Returns the hashes of the ticks in which an action is held, after the beginning of an episode.
fn held(
    game: &dyn Game,
    mode: &str,
    level: u64,
    before: &[ActionValue],
    action: &ActionValue,
) -> Result<Vec<u64>, Fault> {
    let (mut world, agents) = build_world(game, mode, 0, 0, 1);
    let agent = agents[0];
    world.entity_mut(agent).insert((Control::Replay, LevelQueue::Always(level)));
    let mut hashes = Vec::new();
    let all = before.iter().chain(std::iter::repeat_n(action, HELD));
    for (tick, action) in all.enumerate() {
        world.entity_mut(agent).insert(Action(action.clone()));
        tick_world(&mut world)?;
        if tick >= before.len() {
            let state = world.get::<StateHash>(agent).map_or(0, |hash| hash.0);
            hashes.push(hash_with_agent(state, world.get::<Observation>(agent), world.get::<Reward>(agent)));
        }
    }
    Ok(hashes)
}
