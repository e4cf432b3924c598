//! The scripted bot of a foreign game.

use bevy::prelude::*;

use super::runtime::{playing_agent, with_foreign};
use bevy_playbot::{action::Action, agent::Agent, bot::with_noise, control::Control, streams::AgentStreams};

/// Marks an agent that the game's demonstrator plays while its control is [`Control::Bot`].
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub(super) struct ForeignBot {
    /// Probability of a random action, or standard deviation of the noise.
    pub(super) noise: f64,
}

pub(super) fn decide(world: &mut World) {
    let Some(agent) = playing_agent(world) else { return };
    let (Some(&ForeignBot { noise }), Some(Control::Bot)) = (world.get(agent), world.get::<Control>(agent)) else {
        return;
    };
    let planned = with_foreign(world, agent, |world, foreign| match &mut foreign.bot {
        Some(bot) => bot.demand(world),
        None => Err("it has no demonstrator".to_owned()),
    });
    let Some(planned) = planned else { return };
    let mut entity = world.entity_mut(agent);
    let Some(space) = entity.get::<Agent>().map(|agent| agent.actions) else { return };
    let Some(mut streams) = entity.get_mut::<AgentStreams>() else { return };
    let chosen = with_noise(planned, &space, noise, &mut streams.action);
    entity.insert(Action(chosen));
}
