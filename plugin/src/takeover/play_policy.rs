//! `policy:FILE`.

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
    policy::{ActionDraw, ActivePolicy},
    skill_prior::SkillPrior,
};

/// Hands the agents that play over to a policy, and returns who played them.
pub(super) fn start(world: &mut World, path: &Path) -> Result<Vec<Seat>, TakeoverError> {
    let file = PolicyFile::load(path, DeviceKind::default())?;
    let agents = playing_agents(world);
    let misfit = agents.iter().find_map(|&agent| misfit(world, agent, &file));
    if let Some(why) = misfit {
        return Err(TakeoverError::Misfit { path: path.to_owned(), why });
    }
    world.insert_resource(ActivePolicy { policy: file.policy, draw: ActionDraw::default() });
    match &file.skills {
        Some(skills) => world.insert_resource(SkillPrior::from(skills)),
        None => drop(world.remove_resource::<SkillPrior>()),
    }
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

/// Why a policy cannot play this agent of this game. Pictures are checked when it first looks at one.
fn misfit(world: &World, agent: Entity, file: &PolicyFile) -> Option<String> {
    let (game, card) = (world.resource::<GameIdentity>(), &file.card);
    if card.game != game.name {
        return Some(format!("the policy was made for the game `{}`, not for `{}`", card.game, game.name));
    }
    if card.game_version != game.version {
        return Some(format!(
            "the policy was made for version {} of `{}`, whose rules are at version {}: train and export it again",
            card.game_version, game.name, game.version
        ));
    }
    let (made_for, now) = (file.policy.action_space(), world.get::<Agent>(agent)?.actions);
    if made_for != now {
        return Some(format!("the policy acts in {made_for:?}, `{}` in {now:?}", game.name));
    }
    if card.picture.is_some() {
        return None;
    }
    let none = Vec::new();
    let names = world.get::<VectorSensor>(agent).map_or(&none, |sensor| &sensor.space().names);
    let longest = names.len().max(card.observations.len());
    let at = (0..longest).find(|&at| names.get(at) != card.observations.get(at))?;
    let name = |names: &[String]| names.get(at).map_or_else(|| "nothing".to_owned(), |name| format!("`{name}`"));
    Some(format!(
        "the policy reads {} observation values and `{}` gives {}; the first difference is at number {at}: {} there, {} \
         here",
        card.observations.len(),
        game.name,
        names.len(),
        name(&card.observations),
        name(names)
    ))
}
