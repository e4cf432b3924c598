//! A running copy of a game, whose agents play a script of random actions.

use std::{any::TypeId, collections::BTreeSet};

use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionSpace},
    agent::Agent,
    bot::uniform,
    control::Control,
    episode::{Episode, EpisodeEnd, EpisodeEnded},
    headless::{headless_app, into_world, tick_world},
    level::LevelQueue,
    observation::{Observation, VectorSensor},
    renewal::Renewal,
    reward::Reward,
    state_hash::StateHash,
    streams::AgentStreams,
};

use super::census::{Census, types_of};
use crate::{game::Game, worlds::build_world};

/// Ends of episodes in this tick.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
struct Ends(Vec<(Entity, EpisodeEnd)>);

/// An agent's observation, reward and end in a tick.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outcome {
    pub observation: Vec<f32>,
    pub image: Vec<u8>,
    pub reward: f32,
    pub hash: u64,
    pub end: Option<EpisodeEnd>,
}

/// A World with its agents.
pub(super) struct GameCopy {
    pub world: World,
    pub agents: Vec<Entity>,
    pub census: Census,
    /// The fault or panic after which the copy is not ticked any more.
    pub fault: Option<String>,
    first: u32,
    space: ActionSpace,
    scripts: Vec<AgentStreams>,
    in_prelude: bool,
}

/// The game, mode and level that are played.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan<'a> {
    pub mode: &'a str,
    pub level: u64,
    /// Random seed of the World and of the actions.
    pub seed: u64,
}

impl GameCopy {
    /// Builds a World with agents `first..first + count`, all in the same level.
    pub fn new(game: &dyn Game, plan: &Plan, first: u32, count: u32) -> Self {
        let (mut world, agents) = build_world(game, plan.mode, plan.seed, first, count);
        prepare(&mut world);
        for &agent in &agents {
            // Replay without a recording: no other controller decides, and virtual input acts.
            world.entity_mut(agent).insert((Control::Replay, LevelQueue::Always(plan.level)));
        }
        let scripts = (first..first + count).map(|number| AgentStreams::new(plan.seed, number)).collect();
        let (census, fault, space) = (Census::default(), None, game.actions());
        Self { world, agents, census, fault, first, space, scripts, in_prelude: false }
    }

    /// Returns the number of an agent.
    pub fn number(&self, agent: usize) -> u32 {
        self.first + agent as u32
    }

    /// Draws the actions of all agents and runs one tick. A fault or a panic ends this copy.
    pub fn tick(&mut self) {
        if self.fault.is_some() {
            return;
        }
        for (&agent, script) in self.agents.iter().zip(&mut self.scripts) {
            let draws = if self.in_prelude { &mut script.skill } else { &mut script.action };
            self.world.entity_mut(agent).insert(Action(uniform(&self.space, draws)));
        }
        self.world.resource_mut::<Ends>().0.clear();
        let before = self.world.id();
        self.fault = tick_world(&mut self.world).err().map(|fault| fault.to_string());
        if self.world.id() != before {
            // Another World has replaced it, with other entities.
            self.census = Census::default();
        }
        self.census.update(&self.world);
    }

    /// Plays another episode first, with other actions, to its end or for at most `limit` ticks.
    pub fn play_prelude(&mut self, limit: u32) {
        self.in_prelude = true;
        for _ in 0..limit {
            self.tick();
            let ended = |agent: &Entity| self.world.get::<Episode>(*agent).is_some_and(|episode| !episode.is_running());
            if self.fault.is_some() || self.agents.iter().all(ended) {
                break;
            }
        }
        for &agent in &self.agents {
            if let Some(mut episode) = self.world.get_mut::<Episode>(agent) {
                episode.abandon();
            }
        }
        self.in_prelude = false;
    }

    /// Returns an agent's outcome of the tick.
    pub fn outcome(&self, agent: usize) -> Outcome {
        let entity = self.agents[agent];
        let observation = self.world.get::<Observation>(entity).cloned().unwrap_or_default();
        Outcome {
            observation: observation.vector,
            image: observation.image,
            reward: self.world.get::<Reward>(entity).map_or(0.0, Reward::get),
            hash: self.world.get::<StateHash>(entity).map_or(0, |hash| hash.0),
            end: self.end(agent),
        }
    }

    /// Returns how an agent's episode ended in this tick, if it did.
    pub fn end(&self, agent: usize) -> Option<EpisodeEnd> {
        let (entity, ends) = (self.agents[agent], &self.world.resource::<Ends>().0);
        ends.iter().find(|(ended, _)| *ended == entity).map(|(_, end)| *end)
    }

    /// Returns the names of the values that agents observe.
    pub fn observed_names(&self) -> Vec<String> {
        let sensor = self.agents.first().and_then(|&agent| self.world.get::<VectorSensor>(agent));
        sensor.map(|sensor| sensor.space().names.clone()).unwrap_or_default()
    }

    /// Returns the types of all components and resources in this World.
    pub fn present_types(&self) -> BTreeSet<TypeId> {
        let archetypes = self.world.archetypes().iter().filter(|archetype| !archetype.is_empty());
        archetypes.flat_map(|archetype| types_of(&self.world, archetype.components())).collect()
    }
}

/// Adds the examination's own systems and components.
fn prepare(world: &mut World) {
    Renewal::set_up(world, |world| {
        world.init_resource::<Ends>();
        world.add_observer(|event: On<EpisodeEnded>, mut ends: ResMut<Ends>| ends.0.push((event.entity, event.end)));
    });
}

/// Builds a World with the plugin and an agent, without a game, to distinguish the game's types from the others.
pub(super) fn bare_world() -> World {
    let mut world = into_world(headless_app());
    prepare(&mut world);
    world.spawn((Agent::new(0, ActionSpace::Discrete(1)), VectorSensor::new(["nothing"])));
    world
}
