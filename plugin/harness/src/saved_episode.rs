//! Episodes that are saved at the end of a tick, with the state of the game and that of the plugin.
//!
//! ```
//! use bevy::prelude::*;
//! use playbot_harness::{
//!     game::{GameTools, Snapshot, SnapshotTools},
//!     prelude::*,
//!     saved_episode::SavedEpisode,
//!     worlds::build_world,
//! };
//!
//! /// A game that counts its ticks.
//! struct Count;
//!
//! #[derive(Component, Clone, Copy, Debug, Default, PartialEq)]
//! struct Counted(u32);
//!
//! fn count(mut agents: Query<&mut Counted>) {
//!     agents.iter_mut().for_each(|mut counted| counted.0 += 1);
//! }
//!
//! impl Game for Count {
//!     fn name(&self) -> &'static str { "count" }
//!     fn version(&self) -> u32 { 1 }
//!     fn modes(&self) -> &'static [&'static str] { &["default"] }
//!     fn tick_hz(&self) -> f64 { 60.0 }
//!     fn actions(&self) -> ActionSpace { ActionSpace::Discrete(2) }
//!     fn observation(&self) -> ObservationSpace { ObservationSpace { names: Vec::new() } }
//!     fn build(&self, app: &mut App, _mode: &str) {
//!         app.add_systems(FixedUpdate, count);
//!     }
//!     fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
//!         world.spawn((Agent::new(index, self.actions()), Counted::default())).id()
//!     }
//!     fn tools(&self) -> GameTools<'_> {
//!         GameTools { snapshots: self, ..GameTools::default() }
//!     }
//! }
//!
//! impl SnapshotTools for Count {
//!     fn save(&self, world: &World, agent: Entity) -> Option<Snapshot> {
//!         world.get::<Counted>(agent).copied().map(Snapshot::new)
//!     }
//!     fn load(&self, world: &mut World, agent: Entity, snapshot: &Snapshot) -> bool {
//!         let Some(&counted) = snapshot.get::<Counted>() else { return false };
//!         world.entity_mut(agent).insert(counted);
//!         true
//!     }
//! }
//!
//! let (mut world, agents) = build_world(&Count, "default", 0, 0, 1);
//! SavedEpisode::prepare(&Count, &mut world);
//! world.entity_mut(agents[0]).insert((Control::Human, LevelQueue::Always(7)));
//! world.ticks(3).expect("no agent broke its contract");
//! let saved = SavedEpisode::of(&Count, &world, agents[0]).expect("the game saves its state");
//! world.ticks(5).expect("no agent broke its contract");
//! assert!(saved.restore(&Count, &mut world, agents[0]));
//! assert_eq!(world.get::<Counted>(agents[0]), Some(&Counted(3)));
//! assert_eq!(world.get::<Episode>(agents[0]).map(|episode| episode.tick), Some(3));
//! ```

use crate::{
    game::{Game, Snapshot},
    prelude::*,
};
use bevy::prelude::*;
use bevy_playbot::{
    engine::panics::EpisodeTrace,
    legal::{DecisionPeriod, LegalActions},
    streams::AgentStreams,
};

/// What the plugin keeps of an agent that plays.
#[derive(Clone)]
pub(crate) struct AgentState {
    parts: AgentParts,
    /// The decision that holds, and the mask.
    decisions: Option<(DecisionPeriod, Option<LegalActions>)>,
}

#[derive(Bundle, Clone)]
struct AgentParts {
    episode: Episode,
    streams: AgentStreams,
    hash: StateHash,
    observation: Observation,
    action: Action,
    reward: Reward,
}

impl AgentState {
    /// Returns a copy of what the plugin keeps of an agent; `None` if this is none.
    pub(crate) fn of(world: &World, agent: Entity) -> Option<Self> {
        let agent = world.get_entity(agent).ok()?;
        let parts = AgentParts {
            episode: agent.get::<Episode>()?.clone(),
            streams: agent.get::<AgentStreams>()?.clone(),
            hash: *agent.get::<StateHash>()?,
            observation: agent.get::<Observation>()?.clone(),
            action: agent.get::<Action>()?.clone(),
            reward: *agent.get::<Reward>()?,
        };
        let period = agent.get::<DecisionPeriod>().cloned();
        Some(Self { parts, decisions: period.map(|period| (period, agent.get::<LegalActions>().cloned())) })
    }

    /// Gives all of it back to an agent.
    pub(crate) fn put(&self, agent: &mut EntityWorldMut<'_>) {
        agent.insert(self.parts.clone());
        let Some((period, legal)) = &self.decisions else { return };
        agent.insert(period.clone());
        match legal {
            Some(legal) => agent.insert(legal.clone()),
            None => agent.remove::<LegalActions>(),
        };
    }
}

/// An agent's running episode at the end of a tick. Other agents of the game may go on from it, also in other Worlds.
///
/// It has the state of the game, by [`SnapshotTools`](crate::game::SnapshotTools), and what the plugin keeps of an
/// agent: episode, random streams, state hash, observation, action, reward, and the decision that holds. Stacks of
/// pictures, skills, recordings and the states of bots are no part of it.
pub struct SavedEpisode {
    game: Snapshot,
    state: AgentState,
    /// The actions so far, for the report of a panic.
    trace: Option<EpisodeTrace>,
}

impl SavedEpisode {
    /// Lets episodes of a World be saved. Call it before the first of them: some games note their state at the start of
    /// each episode, and save nothing without it.
    pub fn prepare(game: &dyn Game, world: &mut World) {
        game.tools().snapshots.prepare(world);
    }

    /// Saves the episode of an agent. Call it between two ticks, in a World that was [prepared](Self::prepare). Returns
    /// `None` if the agent plays no level, or if the game saves nothing.
    pub fn of(game: &dyn Game, world: &World, agent: Entity) -> Option<Self> {
        world.get::<Episode>(agent).filter(|episode| episode.is_running() && episode.end().is_none())?;
        Some(Self {
            game: game.tools().snapshots.save(world, agent)?,
            state: AgentState::of(world, agent)?,
            trace: world.get::<EpisodeTrace>(agent).cloned(),
        })
    }

    /// Returns the ticks of the episode so far.
    pub fn tick(&self) -> u32 {
        self.state.parts.episode.tick
    }

    /// Puts an agent into the episode, whatever it plays now. Its control and its next levels stay as they
    /// are. Returns false, and changes nothing of the plugin's, if the agent has not played this level last, or if the
    /// game cannot load its state.
    pub fn restore(&self, game: &dyn Game, world: &mut World, agent: Entity) -> bool {
        let played = world.get::<Episode>(agent);
        let is_same =
            played.is_some_and(|played| played.level == self.state.parts.episode.level && !played.is_loading());
        if !is_same || !game.tools().snapshots.load(world, agent, &self.game) {
            return false;
        }
        let Ok(mut agent) = world.get_entity_mut(agent) else { return false };
        self.state.put(&mut agent);
        if let Some(trace) = &self.trace {
            agent.insert(trace.clone());
        }
        true
    }
}
