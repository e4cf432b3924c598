//! The takeover `policy:FILE`.

use std::path::Path;

use bevy::prelude::*;
use playbot_learner::{DeviceKind, PolicyFile};

use super::{
    error::TakeoverError,
    identity::GameIdentity,
    seats::{Seat, forget_skill, playing_agents},
};
use crate::{
    agent::Agent,
    control::Control,
    observation::VectorSensor,
    policy::ActionDraw,
    policy_file::{GameCard, check_policy, install_policy},
};

/// Hands the playing agents over to a policy, and returns the seats of their former players.
pub(super) fn start(world: &mut World, path: &Path) -> Result<Vec<Seat>, TakeoverError> {
    let file = PolicyFile::load(path, DeviceKind::default())?;
    let agents = playing_agents(world);
    let mut cards = agents.iter().filter_map(|&agent| card(world, agent));
    if let Some(why) = cards.find_map(|card| check_policy(&card, &file).err()) {
        return Err(TakeoverError::Misfit { path: path.to_owned(), why: why.to_string() });
    }
    install_policy(world, &file, ActionDraw::default());
    let seats: Vec<Seat> = agents.iter().filter_map(|&agent| Seat::of(world, agent)).collect();
    for agent in agents {
        world.entity_mut(agent).insert(Control::Policy);
        forget_skill(world, agent);
    }
    Ok(seats)
}

/// Gives the agents back.
pub(super) fn stop(world: &mut World, seats: Vec<Seat>) {
    for seat in seats {
        forget_skill(world, seat.agent);
        seat.give_back(world);
    }
}

/// Returns the metadata that a policy must match to play this agent. Names of actions are not known
/// here, and pictures are checked when the policy first reads one.
fn card(world: &World, agent: Entity) -> Option<GameCard<'_>> {
    let game = world.resource::<GameIdentity>();
    let names = world.get::<VectorSensor>(agent).map(|sensor| sensor.space().names.clone());
    Some(GameCard {
        name: &game.name,
        version: game.version,
        observations: names.unwrap_or_default(),
        actions: world.get::<Agent>(agent)?.actions,
        action_names: Vec::new(),
        has_picture: true,
    })
}
