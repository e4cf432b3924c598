//! The replay of recordings whose files lack observations, or masks.

use crate::demo::{Demonstration, Demonstrations};
use bevy::prelude::*;
use bevy_playbot::{
    action::ActionSpace,
    agent::{Agent, Control},
    demo::{
        file::DemoEpisode,
        replay::{Divergence, Replay},
    },
    engine::tick_world,
    fault::Fault,
    legal::LegalActions,
    observation::Observation,
    reward::Reward,
    vision::{ObservationConfig, VisionError},
};
use playbot_harness::{
    demo::{ReplayedEpisodes, VerifyError},
    game::Game,
    parallel::on_threads,
    randomise::follow_recordings,
    sensors::GameSensors,
    worlds::{at_most, build_observing_world},
};
use playbot_learner::{ObsKind, Observations};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

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
        let is_wanted = |i: usize| !self.episodes[i].is_seen && originals[i] == i;
        let mut all = self.nothing_to_see(game);
        for observed in self.replayed(game, threads, is_wanted, replay, progress)? {
            if let Some(divergence) = observed.divergence {
                let Demonstration { file, index, .. } = &self.episodes[observed.id];
                return Err(VerifyError::Diverged { path: file.to_path_buf(), episode: *index, divergence });
            }
            all.insert(observed.id, observed);
        }
        Ok(all)
    }

    /// Returns the masks of the distinct episodes whose observations are in a file, by the index of the episode.
    /// Recordings hold no masks, so a replay restores them. It is `None` for an episode that does not replay. Without
    /// masks in the first such episode of each mode the game has none, and nothing is returned.
    ///
    /// # Errors
    ///
    /// [`VerifyError::Fault`] if a game with masks breaks its contract.
    pub fn masks_of_seen(
        &self,
        game: &dyn Game,
        threads: usize,
        originals: &[usize],
    ) -> Result<BTreeMap<usize, Option<Vec<bool>>>, VerifyError> {
        let is_seen = |i: usize| self.episodes[i].is_seen && originals[i] == i && !self.episodes[i].episode.is_empty();
        let mut modes = BTreeSet::new();
        let seen = (0..self.episodes.len()).filter(|&i| is_seen(i));
        let firsts: Vec<usize> = seen.filter(|&i| modes.insert(&self.episodes[i].mode)).collect();
        // Recordings of a game without masks need not replay here.
        let probe = self.replayed(game, 1, |i| firsts.contains(&i), Replay::new, &|_| {});
        if !probe.is_ok_and(|probe| probe.iter().any(|observed| !observed.legal.is_empty())) {
            return Ok(BTreeMap::new());
        }
        let replayed = self.replayed(game, threads, is_seen, Replay::new, &|_| {})?;
        let known = |observed: &ObservedEpisode| observed.divergence.is_none();
        Ok(replayed.into_iter().map(|observed| (observed.id, known(&observed).then_some(observed.legal))).collect())
    }

    /// Replays the episodes whose index is wanted, mode by mode: first beside others, and where that diverges, alone.
    fn replayed(
        &self,
        game: &dyn Game,
        threads: usize,
        is_wanted: impl Fn(usize) -> bool,
        replay: impl Fn(Arc<DemoEpisode>) -> Replay,
        progress: &(impl Fn(u64) + Sync),
    ) -> Result<Vec<ObservedEpisode>, VerifyError> {
        let mut by_mode: BTreeMap<&str, Vec<Job>> = BTreeMap::new();
        for (i, demo) in self.episodes.iter().enumerate() {
            if is_wanted(i) && !demo.episode.is_empty() {
                by_mode.entry(&demo.mode).or_default().push((i, replay(demo.episode.clone())));
            }
        }
        let mut all = Vec::new();
        for (mode, jobs) in by_mode {
            let observed = observe_replays(game, &self.observation_config, mode, jobs, threads, progress);
            for observed in observed.map_err(|error| self.explained(error))? {
                all.push(match observed.divergence {
                    None => observed,
                    Some(_) => self.observe_alone(game, mode, observed, &replay)?,
                });
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
            legal: Vec::new(),
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
    /// An entry for each discrete action of each step: true if it was legal, or the recorded one. Empty without masks.
    pub legal: Vec<bool>,
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
    // Values that a level has drawn are those of its World.
    let draws = jobs.iter().any(|(_, replay)| !replay.episode().randomised.is_empty());
    let side_by_side = if draws { 1 } else { at_most(game, SIDE_BY_SIDE) };
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
        if job.as_ref().is_some_and(|(_, replay)| !replay.episode().randomised.is_empty()) {
            follow_recordings(&mut self.world);
        }
        let mut entity = self.world.entity_mut(self.agents[agent]);
        let Some((id, replay)) = job else {
            entity.insert(Control::Idle);
            return;
        };
        let observations = Observations::with_capacity(&self.kind, replay.episode().len());
        replay.start(&mut entity);
        let (rewards, legal) = (Vec::new(), Vec::new());
        self.replaying[agent] = Some(ObservedEpisode { id, observations, rewards, legal, divergence: None });
    }

    /// Stores an agent's observation, mask and reward of this tick. Returns the episode after its last tick.
    fn note(&mut self, agent: usize) -> Option<ObservedEpisode> {
        let observed = self.replaying[agent].as_mut()?;
        let entity = self.world.entity(self.agents[agent]);
        // After a tick the agent still has the observation that it acted on.
        entity.get::<Observation>()?.push_to(&mut observed.observations);
        let replay = entity.get::<Replay>()?;
        let (mask, agent_actions) = (entity.get::<LegalActions>(), &entity.get::<Agent>()?.actions);
        push_mask(&mut observed.legal, observed.rewards.len(), mask, agent_actions, replay);
        observed.rewards.push(entity.get::<Reward>()?.get());
        if !replay.is_finished() {
            return None;
        }
        observed.divergence = replay.divergence().cloned();
        self.replaying[agent].take()
    }
}

/// Adds the mask of a tick to those of the ticks before it. Without a mask every action is legal. People may press what
/// is illegal, and the recorded action has to be a possible one for a learner: numbers that differ from those that an
/// earlier decision holds are a decision.
fn push_mask(legal: &mut Vec<bool>, tick: usize, mask: Option<&LegalActions>, space: &ActionSpace, replay: &Replay) {
    let width = space.mask_width();
    if mask.is_none() && legal.is_empty() {
        return;
    }
    legal.resize(tick * width, true);
    legal.extend(mask.iter().flat_map(|mask| mask.entries(space)));
    legal.resize((tick + 1) * width, true);
    let Some(action) = replay.episode().actions.get(tick) else { return };
    for (at, &option) in space.choices().ranges().zip(action.options()) {
        if let Some(is_legal) = legal.get_mut(tick * width + at.start + option as usize) {
            *is_legal = true;
        }
    }
    if let (Some(is_held), true) = (legal.last_mut(), space.numbers() > 0) {
        *is_held |= mask.is_some_and(|mask| !mask.allows_numbers(action.numbers()));
    }
}
