//! Reward and end of a tick, read from the game's state.

use bevy::prelude::*;

use super::{
    fingerprint,
    runtime::{playing_agent, with_foreign},
};
use bevy_playbot::{
    episode::{Episode, EpisodeEnd},
    reward::Reward,
    state_hash::StateHash,
};

/// Reads reward and end, after the game's frame.
pub(super) fn read_outcome(world: &mut World) {
    let Some(agent) = playing_agent(world) else { return };
    let tick = world.get::<Episode>(agent).map_or(0, |episode| episode.tick);
    let outcome = with_foreign(world, agent, |world, foreign| {
        let mut reward = 0.0;
        for part in &mut foreign.rewards {
            // A value of an entity that does not exist now pays nothing.
            let Some(value) = part.system.run(world)? else { continue };
            reward += if part.is_delta { value - part.last.unwrap_or(value) } else { value };
            part.last = Some(value);
        }
        let end = match &mut foreign.end {
            Some(system) => system.run(world)?.flatten(),
            None => None,
        };
        let time_is_up = foreign.game.description.limit.is_some_and(|limit| tick + 1 >= limit);
        let end = end.or(time_is_up.then_some(EpisodeEnd::Truncated));
        let state = match &mut foreign.hash {
            Some(system) => system.demand(world)?,
            None => foreign.baseline.as_ref().map_or(0, |baseline| fingerprint::of_transforms(world, baseline)),
        };
        Ok((reward, end, state))
    });
    let Some((reward, end, state)) = outcome else { return };
    let mut agent = world.entity_mut(agent);
    if let Some(mut paid) = agent.get_mut::<Reward>() {
        paid.add(reward);
    }
    let hash = fingerprint::with_agent(state, agent.get(), agent.get());
    agent.insert(StateHash(hash));
    if let Some(mut episode) = agent.get_mut::<Episode>() {
        match end {
            Some(EpisodeEnd::Terminated { success }) => episode.terminate(success),
            Some(EpisodeEnd::Truncated) => episode.truncate(),
            None => {}
        }
    }
}
