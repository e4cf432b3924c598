//! Games that do not play the same twice.

use bevy::prelude::*;
use bevy_playbot::{
    action::Action, episode::Episode, fault::Fault, observation::Observation, reward::Reward, state_hash::StateHash,
};

use super::{
    level_detector::{LevelDefect, LevelDetector, TestedBy, TestedLevel},
    probe::Probe,
};
use crate::detector::Setting;

/// Two Worlds in which the same tester plays the same episode differ. A tester's first episode on some of the levels is
/// played twice more, so it is not usual.
pub struct Determinism {
    every: f64,
    ticks: f64,
}

impl Default for Determinism {
    fn default() -> Self {
        Self { every: 10.0, ticks: 1000.0 }
    }
}

impl Determinism {
    /// A hash for each tick of the episode.
    fn play(&self, level: &TestedLevel<'_>, tester: &TestedBy<'_>) -> Result<Vec<u64>, Fault> {
        let (player, config) = (tester.player, &tester.observation_config);
        let probe = Probe::new(level.game, level.mode, level.level, player, config, vec![tester.seed]);
        let mut probe = probe.map_err(|error| Fault(error.to_string()))?;
        let mut hashes = Vec::new();
        for _ in 0..self.ticks as u32 {
            let is_active = probe.tick()?;
            if !is_loading(&probe) {
                hashes.push(hash(&probe.world, probe.agent));
            }
            if !is_active || probe.is_over() {
                break;
            }
        }
        Ok(hashes)
    }
}

fn is_loading(probe: &Probe) -> bool {
    probe.world.get::<Episode>(probe.agent).is_some_and(Episode::is_loading)
}

/// All that is known of the state, and what was done.
fn hash(world: &World, agent: Entity) -> u64 {
    let action = world.get::<Action>(agent);
    let done = action.and_then(Action::continuous).unwrap_or(&[]);
    let choice = action.and_then(Action::discrete).unwrap_or(0);
    let done = done.iter().map(|number| u64::from(number.to_bits()));
    StateHash::of([hash_of_state(world, agent), u64::from(choice)].into_iter().chain(done)).0
}

/// All that is known of the state.
pub(super) fn hash_of_state(world: &World, agent: Entity) -> u64 {
    let state = world.get::<StateHash>(agent).map_or(0, |hash| hash.0);
    let reward = world.get::<Reward>(agent).map_or(0.0, Reward::get);
    let seen = world.get::<Observation>(agent).map_or(&[][..], |observation| observation.vector.as_slice());
    let numbers = seen.iter().chain([&reward]).map(|number| u64::from(number.to_bits()));
    StateHash::of([state].into_iter().chain(numbers)).0
}

impl LevelDetector for Determinism {
    fn name(&self) -> &'static str {
        "determinism"
    }

    fn describe(&self) -> &'static str {
        "the same tester with the same seed does not have the same episode again"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![
            Setting::new("every", &mut self.every, "look at every so many-th level of the range").at_least(1.0),
            Setting::new("ticks", &mut self.ticks, "ticks that are compared").at_least(1.0),
        ]
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        if !level.is_sample(self.every) {
            return Vec::new();
        }
        let of_tester = |tester: &TestedBy<'_>| {
            // A game that breaks is found by others.
            let (one, other) = (self.play(level, tester).ok()?, self.play(level, tester).ok()?);
            let tick = first_difference(&one, &other)?;
            let message = "the episode was another one when it was played again; `playbot doctor` names what differs";
            Some(LevelDefect {
                tester: Some(tester.name.to_owned()),
                episode: Some(0),
                tick: Some(tick),
                message: message.to_owned(),
            })
        };
        level.testers.iter().filter_map(of_tester).collect()
    }
}

/// The first tick that differs, or the first that one of them lacks.
fn first_difference(one: &[u64], other: &[u64]) -> Option<u32> {
    let shared = one.iter().zip(other).position(|(one, other)| one != other);
    let longer = (one.len() != other.len()).then(|| one.len().min(other.len()));
    shared.or(longer).map(|tick| tick as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_tick_that_differs_is_named() {
        assert_eq!(first_difference(&[1, 2, 3], &[1, 2, 3]), None);
        assert_eq!(first_difference(&[1, 2, 3], &[1, 4, 3]), Some(1));
        assert_eq!(first_difference(&[1, 2, 3], &[1, 2]), Some(2));
    }
}
