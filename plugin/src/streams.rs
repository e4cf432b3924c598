//! Random streams: one seed for a World, and separate streams for each agent.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{prelude::*, streams::AgentStreams};
//!
//! let streams_of_agent_3 = |seed, others: u32| {
//!     let mut app = headless_app();
//!     app.insert_resource(PlaybotSeed(seed));
//!     let agent = app.world_mut().spawn(Agent::new(3, ActionSpace::Discrete(2))).id();
//!     for index in 0..others {
//!         app.world_mut().spawn(Agent::new(index, ActionSpace::Discrete(2)));
//!     }
//!     app.tick().expect("each has a number of its own");
//!     app.world().get::<AgentStreams>(agent).expect("every agent has them").clone()
//! };
//! assert_eq!(streams_of_agent_3(7, 0), streams_of_agent_3(7, 2), "others change nothing");
//! assert_ne!(streams_of_agent_3(7, 0), streams_of_agent_3(8, 0));
//! ```

use crate::{
    agent::Agent,
    carry_over::{ReflectCarryComponent, ReflectCarryResource},
};
use bevy::prelude::*;
use playbot_learner::Streams;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Gives every agent its streams.
pub(crate) fn plugin(app: &mut App) {
    app.init_resource::<PlaybotSeed>().register_required_components::<Agent, AgentStreams>();
}

/// Seed from which all random streams of this World derive.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Resource, CarryResource)]
pub struct PlaybotSeed(pub u64);

/// An agent's own random streams, independent of the other agents in its World.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, CarryComponent, Clone, Debug, PartialEq)]
pub struct AgentStreams {
    /// For the choice of levels.
    pub level: ChaCha8Rng,
    /// For the draw of actions.
    pub action: ChaCha8Rng,
    /// For the draw of skills.
    pub skill: ChaCha8Rng,
    seeded: bool,
}

impl Default for AgentStreams {
    fn default() -> Self {
        let unseeded = ChaCha8Rng::seed_from_u64(0);
        Self { level: unseeded.clone(), action: unseeded.clone(), skill: unseeded, seeded: false }
    }
}

impl AgentStreams {
    /// Returns the streams of agent `index` under `seed`.
    pub fn new(seed: u64, index: u32) -> Self {
        let streams = Streams::new(seed);
        let stream = |name| streams.stream(name, u64::from(index));
        Self { level: stream("level"), action: stream("action"), skill: stream("skill"), seeded: true }
    }

    /// Begins the streams of agent `index`, unless they have begun.
    pub(crate) fn seed(&mut self, seed: PlaybotSeed, index: u32) {
        if !self.seeded {
            *self = Self::new(seed.0, index);
        }
    }

    /// Restores streams in the middle of their run, from a checkpoint.
    pub fn restored(level: ChaCha8Rng, action: ChaCha8Rng, skill: ChaCha8Rng) -> Self {
        Self { level, action, skill, seeded: true }
    }
}

/// Seeds of an agent's next episodes, in order. At the start of each episode the agent's streams
/// begin anew from the next seed. So no draw depends on earlier episodes, or on the agent and World
/// that play it. After the last seed the streams run on.
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, CarryComponent)]
pub struct EpisodeSeeds {
    seeds: Vec<u64>,
    used: usize,
}

impl EpisodeSeeds {
    /// Creates the list; the first seed is that of the next episode.
    pub fn new(seeds: impl Into<Vec<u64>>) -> Self {
        Self { seeds: seeds.into(), used: 0 }
    }

    /// Returns the streams of an episode with this seed.
    pub fn streams(seed: u64) -> AgentStreams {
        AgentStreams::new(seed, 0)
    }

    /// Returns the streams of the episode that begins now.
    pub(crate) fn next_streams(&mut self) -> Option<AgentStreams> {
        let seed = self.seeds.get(self.used).copied()?;
        self.used += 1;
        Some(Self::streams(seed))
    }
}

/// Gives agents their streams, unless they have some already.
pub(crate) fn seed_streams(seed: Res<PlaybotSeed>, mut added: Query<(&Agent, &mut AgentStreams), Added<Agent>>) {
    for (agent, mut streams) in &mut added {
        streams.seed(*seed, agent.index);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_seed_begins_one_episode() {
        let mut seeds = EpisodeSeeds::new([7, 8]);
        assert_eq!(seeds.next_streams(), Some(AgentStreams::new(7, 0)));
        assert_eq!(seeds.next_streams(), Some(EpisodeSeeds::streams(8)));
        assert_eq!(seeds.next_streams(), None);
    }
}
