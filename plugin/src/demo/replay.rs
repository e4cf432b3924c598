//! Replay of a recording, and detection of the first tick that differs.
//!
//! ```
//! use std::sync::Arc;
//!
//! use bevy::prelude::*;
//! use bevy_playbot::{
//!     action::Actions,
//!     demo::{file::{Decider, DemoEpisode}, replay::ReplayDiverged},
//!     prelude::*,
//! };
//!
//! #[derive(Resource, Default)]
//! struct Heard(Vec<String>);
//!
//! // Three ticks of a game without reward. A `DemoReader` returns such episodes.
//! let mut episode = DemoEpisode::new(7, ActionSpace::Discrete(2));
//! episode.actions = Actions::Discrete(vec![1, 0, 1]);
//! (episode.rewards, episode.state_hashes, episode.deciders) = (vec![0.0; 3], vec![0; 3], vec![Decider::Human; 3]);
//!
//! let mut app = headless_app();
//! app.init_resource::<Heard>()
//!     .add_observer(|event: On<ReplayDiverged>, mut heard: ResMut<Heard>| heard.0.push(event.divergence.to_string()))
//!     // By now the second tick gives a point.
//!     .add_systems(FixedUpdate, |mut agents: Query<(&Episode, &mut Reward)>| {
//!         agents.iter_mut().filter(|(episode, _)| episode.tick == 1).for_each(|(_, mut reward)| reward.add(1.0));
//!     });
//! let agent = app.world_mut().spawn(Agent::new(0, ActionSpace::Discrete(2))).id();
//! Replay::begin(Arc::new(episode), &mut app.world_mut().entity_mut(agent));
//! app.ticks(3).expect("no agent broke its contract");
//! assert!(app.world().get::<Replay>(agent).is_some_and(Replay::is_finished));
//! assert_eq!(app.world().resource::<Heard>().0, ["level 7, tick 1: the reward is 1, but 0 in the recording"]);
//! ```

use crate::{
    action::Action,
    agent::Control,
    carry_over::ReflectCarryComponent,
    demo::file::{DemoEnd, DemoEpisode},
    episode::{Episode, EpisodeEnd},
    level::{LevelFiles, LevelQueue},
    reward::Reward,
    state_hash::StateHash,
    streams::AgentStreams,
};
use bevy::prelude::*;
use std::sync::Arc;
use thiserror::Error;

/// The recorded episode that drives an agent under [`Control::Replay`].
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, CarryComponent, Clone, Debug)]
pub struct Replay {
    episode: Arc<DemoEpisode>,
    divergence: Option<Divergence>,
    finished: bool,
    /// True if a reward other than the recorded one is a divergence.
    compares_rewards: bool,
}

/// A replay has diverged from the recording. Triggered once in a replay, in the tick that differs.
#[derive(EntityEvent, Clone, Debug, PartialEq, Reflect)]
pub struct ReplayDiverged {
    /// The agent that replays.
    pub entity: Entity,
    /// The position and the kind of the difference.
    pub divergence: Divergence,
}

/// The first difference of a replay from its recording.
#[derive(Clone, Debug, Error, PartialEq, Reflect)]
#[error("level {level}, tick {tick}: {what}")]
pub struct Divergence {
    /// The level.
    pub level: u64,
    /// The tick, from 0.
    pub tick: u32,
    /// The difference, as text.
    pub what: String,
}

impl Replay {
    /// Creates a replay of this episode. The agent's level queue must give the episode's level.
    pub fn new(episode: Arc<DemoEpisode>) -> Self {
        Self { episode, divergence: None, finished: false, compares_rewards: true }
    }

    /// Accepts the game's current rewards in place of the recorded ones, as long as the game is in the recorded
    /// states. If no state was ever hashed, rewards are the only evidence, and are compared all the same.
    #[must_use]
    pub fn paid_anew(self) -> Self {
        let compares_rewards = self.episode.state_hashes.iter().all(|&hash| hash == 0);
        Self { compares_rewards, ..self }
    }

    /// Hands an agent over to this recording, from its first tick on. The agent's running episode is abandoned. Where
    /// levels are files, the level is the current number of the recorded file.
    pub fn begin(episode: Arc<DemoEpisode>, agent: &mut EntityWorldMut) {
        Self::new(episode).start(agent);
    }

    /// Hands an agent over to this replay, as [`begin`](Self::begin) does.
    pub fn start(self, agent: &mut EntityWorldMut) {
        let episode = &self.episode;
        if let Some(mut running) = agent.get_mut::<Episode>() {
            running.abandon();
        }
        let files = agent.world().get_resource::<LevelFiles>();
        let recorded = episode.level_file.as_ref().zip(files).and_then(|(file, files)| files.number_of(file));
        let queue = LevelQueue::Always(recorded.unwrap_or(episode.level_seed));
        agent.insert((Control::Replay, queue, self, AgentStreams::new(0, 0)));
    }

    /// Returns the first difference between the recording and the game so far. [`ReplayDiverged`] announces it.
    pub fn divergence(&self) -> Option<&Divergence> {
        self.divergence.as_ref()
    }

    /// Returns whether the last recorded tick has been played, or the game ended before it.
    pub fn is_finished(&self) -> bool {
        self.finished
    }

    /// Returns the recorded episode.
    pub fn episode(&self) -> &DemoEpisode {
        &self.episode
    }
}

pub(crate) fn run_replays(mut agents: Query<(&Control, &Episode, &mut Replay, &mut Action)>) {
    for (control, episode, mut replay, mut action) in &mut agents {
        if *control != Control::Replay || !episode.is_running() {
            continue;
        }
        match replay.episode.actions.get(episode.tick as usize) {
            Some(value) => action.0 = value,
            None => replay.finished = true,
        }
    }
}

pub(crate) fn check_replays(
    mut agents: Query<(Entity, &Control, &Episode, &Reward, &StateHash, &mut Replay)>,
    files: Option<Res<LevelFiles>>,
    mut commands: Commands,
) {
    for (entity, control, episode, reward, hash, mut replay) in &mut agents {
        if *control != Control::Replay || !episode.is_running() || replay.finished {
            continue;
        }
        // This tick has been counted already.
        let tick = episode.tick.saturating_sub(1);
        let demo = &*replay.episode;
        // On another level no other difference matters.
        let is_other = (tick == 0).then(|| other_level(demo, episode.level, files.as_deref())).flatten();
        let paid = replay.compares_rewards.then(|| reward.get());
        let what = is_other.or_else(|| difference(demo, tick as usize, paid, hash.folded(), episode.end()));
        if replay.divergence.is_none()
            && let Some(what) = what
        {
            let divergence = Divergence { level: episode.level, tick, what };
            replay.divergence = Some(divergence.clone());
            commands.trigger(ReplayDiverged { entity, divergence });
        }
        replay.finished = episode.end().is_some() || tick as usize + 1 >= replay.episode.len();
    }
}

/// Returns why the level is not the recorded file, if it is not.
fn other_level(demo: &DemoEpisode, level: u64, files: Option<&LevelFiles>) -> Option<String> {
    let recorded = demo.level_file.as_ref()?;
    match files {
        Some(files) => files.difference(level, recorded),
        None => Some(format!("the recorded level is the file {recorded}, but the levels here are not files")),
    }
}

/// Returns the difference of this tick from the recording. The reward is compared only if it is given.
fn difference(
    demo: &DemoEpisode,
    tick: usize,
    reward: Option<f32>,
    hash: u32,
    end: Option<EpisodeEnd>,
) -> Option<String> {
    let (recorded_hash, recorded_reward) = (*demo.state_hashes.get(tick)?, *demo.rewards.get(tick)?);
    let recorded_end = if tick + 1 < demo.len() {
        None
    } else {
        match demo.end {
            DemoEnd::Terminated { success } => Some(EpisodeEnd::Terminated { success }),
            DemoEnd::Truncated => Some(EpisodeEnd::Truncated),
            // An aborted recording does not show how the game would have gone on.
            DemoEnd::Aborted => end,
        }
    };
    if recorded_hash != hash {
        Some(format!("the state hash is {hash:08x}, but {recorded_hash:08x} in the recording"))
    } else if let Some(reward) = reward.filter(|reward| reward.to_bits() != recorded_reward.to_bits()) {
        Some(format!("the reward is {reward}, but {recorded_reward} in the recording"))
    } else if recorded_end != end {
        Some(format!("the episode's end is {end:?}, but {recorded_end:?} in the recording"))
    } else {
        None
    }
}
