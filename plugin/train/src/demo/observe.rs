//! The replay of recordings whose files lack observations.

use crate::demo::{Demonstration, Demonstrations};
use bevy::prelude::*;
use bevy_playbot::{
    agent::Control,
    demo::{
        file::DemoEpisode,
        replay::{Divergence, Replay},
    },
    engine::tick_world,
    fault::Fault,
    observation::Observation,
    reward::Reward,
    vision::{ObservationConfig, VisionError},
};
use playbot_harness::{
    demo::{ReplayedEpisodes, VerifyError},
    game::Game,
    parallel::on_threads,
    sensors::GameSensors,
    worlds::{at_most, build_observing_world},
};
use playbot_learner::{ObsKind, Observations};
use std::{collections::BTreeMap, sync::Arc};

impl Demonstrations {
    /// Replays the episodes whose observations are not in a file, mode by mode, each distinct demonstration once.
    /// Returns the results by the index of the episode. `replay` says what is compared with the recordings.
    ///
    /// # Errors
    ///
    /// [`VerifyError::Diverged`] for the first episode that does not replay, or [`VerifyError::Fault`].
    pub fn observe(
        &self,
        game: &dyn Game,
        threads: usize,
        originals: &[usize],
        replay: impl Fn(Arc<DemoEpisode>) -> Replay,
        progress: &(impl Fn(u64) + Sync),
    ) -> Result<BTreeMap<usize, ObservedEpisode>, VerifyError> {
        let mut by_mode: BTreeMap<&str, Vec<Job>> = BTreeMap::new();
        for (i, demo) in self.episodes.iter().enumerate() {
            if !demo.is_seen && originals[i] == i && !demo.episode.is_empty() {
                by_mode.entry(&demo.mode).or_default().push((i, replay(demo.episode.clone())));
            }
        }
        let mut all = self.nothing_to_see(game);
        for (mode, jobs) in by_mode {
            let observed = observe_replays(game, &self.observation_config, mode, jobs, threads, progress);
            for observed in observed.map_err(|error| self.explained(error))? {
                let observed = match observed.divergence {
                    None => observed,
                    Some(_) => self.observe_alone(game, mode, observed, &replay)?,
                };
                if let Some(divergence) = observed.divergence {
                    let Demonstration { file, index, .. } = &self.episodes[observed.id];
                    return Err(VerifyError::Diverged { path: file.to_path_buf(), episode: *index, divergence });
                }
                all.insert(observed.id, observed);
            }
        }
        Ok(all)
    }

    /// Replays an episode again, alone in a new World, where a game that keeps something from other episodes has none
    /// of it. Every recording that `demo verify` accepts replays there, and its observations are those of its states.
    fn observe_alone(
        &self,
        game: &dyn Game,
        mode: &str,
        observed: ObservedEpisode,
        replay: &impl Fn(Arc<DemoEpisode>) -> Replay,
    ) -> Result<ObservedEpisode, VerifyError> {
        let job = (observed.id, replay(self.episodes[observed.id].episode.clone()));
        let again = observe_replays(game, &self.observation_config, mode, vec![job], 1, &|_| {});
        let again = again.map_err(|error| self.explained(error))?;
        Ok(again.into_iter().next().unwrap_or(observed))
    }

    /// Returns an error with the files of the episodes that were played.
    fn explained(&self, error: ReplayError) -> VerifyError {
        let place = |id: usize| (self.episodes[id].file.to_path_buf(), self.episodes[id].index);
        match error {
            ReplayError::Vision(error) => error.into(),
            ReplayError::Fault { ids, fault } => {
                VerifyError::Fault { replayed: ReplayedEpisodes::new(ids.into_iter().map(place)), fault }
            }
        }
    }

    /// Returns empty results for the episodes that were left before their first tick.
    fn nothing_to_see(&self, game: &dyn Game) -> BTreeMap<usize, ObservedEpisode> {
        let kind = self.observation_config.obs_kind(game);
        let empty = self.episodes.iter().enumerate().filter(|(_, demo)| demo.episode.is_empty());
        let nothing = |id| ObservedEpisode {
            id,
            observations: Observations::empty(&kind),
            rewards: Vec::new(),
            divergence: None,
        };
        empty.map(|(id, _)| (id, nothing(id))).collect()
    }
}

// Replays of many recordings at a time.

/// Recordings that one World replays at the same time. They share the cost of a tick and of a camera.
const SIDE_BY_SIDE: usize = 16;

/// A replay with its number.
pub type Job = (usize, Replay);

/// An agent's observations and rewards in an episode.
pub struct ObservedEpisode {
    /// Number of the job.
    pub id: usize,
    /// The observation before each action.
    pub observations: Observations,
    /// The reward of each action.
    pub rewards: Vec<f32>,
    /// The first divergence from the recorded episode, if there is one.
    pub divergence: Option<Divergence>,
}

/// The errors of replays.
pub enum ReplayError {
    /// The game broke its contract while these jobs were played side by side.
    Fault {
        /// Numbers of the jobs.
        ids: Vec<usize>,
        /// The fault.
        fault: Fault,
    },
    /// The game cannot be observed this way.
    Vision(VisionError),
}

impl From<VisionError> for ReplayError {
    fn from(error: VisionError) -> Self {
        Self::Vision(error)
    }
}

/// Replays episodes of one mode on at most `threads` threads. Their number changes no observation.
///
/// # Errors
///
/// [`ReplayError`] if the game breaks its contract or cannot be observed this way.
pub fn observe_replays(
    game: &dyn Game,
    observation_config: &ObservationConfig,
    mode: &str,
    jobs: Vec<Job>,
    threads: usize,
    progress: &(impl Fn(u64) + Sync),
) -> Result<Vec<ObservedEpisode>, ReplayError> {
    let side_by_side = at_most(game, SIDE_BY_SIDE);
    let threads = threads.clamp(1, jobs.len().div_ceil(side_by_side).max(1));
    let mut shares: Vec<Vec<Job>> = vec![Vec::new(); threads];
    for (i, job) in jobs.into_iter().enumerate() {
        shares[i % threads].push(job);
    }
    let parts = on_threads(&mut shares, threads, |share| {
        let jobs = std::mem::take(share);
        ReplayWorld::new(game, observation_config, mode, jobs.len().min(side_by_side))?.play(jobs, progress)
    });
    let mut all = Vec::new();
    for part in parts {
        all.extend(part?);
    }
    Ok(all)
}

/// A World whose agents replay one episode after the other.
struct ReplayWorld {
    world: World,
    agents: Vec<Entity>,
    /// The episode that each agent replays.
    replaying: Vec<Option<ObservedEpisode>>,
    kind: ObsKind,
}

impl ReplayWorld {
    fn new(
        game: &dyn Game,
        observation_config: &ObservationConfig,
        mode: &str,
        count: usize,
    ) -> Result<Self, ReplayError> {
        let (world, agents) = build_observing_world(game, mode, observation_config, 0, 0, count as u32)?;
        let replaying = agents.iter().map(|_| None).collect();
        Ok(Self { world, agents, replaying, kind: observation_config.obs_kind(game) })
    }

    fn play(mut self, jobs: Vec<Job>, progress: &impl Fn(u64)) -> Result<Vec<ObservedEpisode>, ReplayError> {
        let mut jobs = jobs.into_iter();
        let mut done = Vec::new();
        loop {
            for agent in 0..self.agents.len() {
                if self.replaying[agent].is_none() {
                    self.begin(agent, jobs.next());
                }
            }
            let busy = self.replaying.iter().flatten().count();
            if busy == 0 {
                return Ok(done);
            }
            if let Err(fault) = tick_world(&mut self.world) {
                let ids = self.replaying.iter().flatten().map(|observed| observed.id).collect();
                return Err(ReplayError::Fault { ids, fault });
            }
            done.extend((0..self.agents.len()).filter_map(|agent| self.note(agent)));
            progress(busy as u64);
        }
    }

    /// Gives an agent the next episode, or makes it idle if there is none.
    fn begin(&mut self, agent: usize, job: Option<Job>) {
        let mut entity = self.world.entity_mut(self.agents[agent]);
        let Some((id, replay)) = job else {
            entity.insert(Control::Idle);
            return;
        };
        let observations = Observations::with_capacity(&self.kind, replay.episode().len());
        replay.start(&mut entity);
        self.replaying[agent] = Some(ObservedEpisode { id, observations, rewards: Vec::new(), divergence: None });
    }

    /// Stores an agent's observation and reward of this tick. Returns the episode after its last tick.
    fn note(&mut self, agent: usize) -> Option<ObservedEpisode> {
        let observed = self.replaying[agent].as_mut()?;
        let entity = self.world.entity(self.agents[agent]);
        // After a tick the agent still has the observation that it acted on.
        entity.get::<Observation>()?.push_to(&mut observed.observations);
        observed.rewards.push(entity.get::<Reward>()?.get());
        let replay = entity.get::<Replay>().filter(|replay| replay.is_finished())?;
        observed.divergence = replay.divergence().cloned();
        self.replaying[agent].take()
    }
}
