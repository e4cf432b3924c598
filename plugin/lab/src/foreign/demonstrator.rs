//! A scripted bot that sees the World.

use bevy::prelude::*;
use rand::RngExt;

use super::runtime::{playing_agent, with_foreign};
use bevy_playbot::{
    action::{Action, ActionValue},
    agent::Agent,
    bot::uniform,
    control::Control,
    policy::AgentStreams,
};

/// The agent is played by the game's demonstrator while its control is [`Control::Bot`].
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
    let rng = &mut streams.action;
    let chosen = match planned {
        ActionValue::Discrete(_) if noise > 0.0 && rng.random_bool(noise.min(1.0)) => uniform(&space, rng),
        ActionValue::Continuous(values) if noise > 0.0 => {
            let noisy = |value: f32| (value + noise as f32 * playbot_learner::rng::normal(rng)).clamp(-1.0, 1.0);
            ActionValue::Continuous(values.into_iter().map(noisy).collect())
        }
        planned => planned,
    };
    entity.insert(Action(chosen));
}
