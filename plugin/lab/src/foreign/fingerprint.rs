//! The default state hash of a foreign game.

use bevy::prelude::*;

use super::kept::Baseline;
use bevy_playbot::{observation::Observation, reward::Reward, state_hash::StateHash};

/// Returns a hash of the transforms of all entities of the game. The ids of entities and their order in memory do not
/// matter.
pub(super) fn of_transforms(world: &World, baseline: &Baseline) -> u64 {
    let mut sum = 0_u64;
    for entity in baseline.spawned(world) {
        let Some(transform) = world.get::<Transform>(entity) else { continue };
        if !baseline.is_placed(world, entity) {
            continue;
        }
        let Transform { translation, rotation, scale } = transform;
        let numbers = [translation.to_array(), scale.to_array()].into_iter().flatten().chain(rotation.to_array());
        sum = sum.wrapping_add(StateHash::of(numbers.map(|number| u64::from(number.to_bits()))).0);
    }
    sum
}

/// Returns the hash of the state, with the agent's observation and reward.
pub(super) fn with_agent(state: u64, observation: Option<&Observation>, reward: Option<&Reward>) -> u64 {
    let reward = reward.map_or(0, |reward| u64::from(reward.get().to_bits()));
    let seen = observation.into_iter().flat_map(|seen| seen.vector.iter().map(|value| u64::from(value.to_bits())));
    StateHash::of([state, reward].into_iter().chain(seen)).0
}
