//! Playing a recording back, and finding the first tick at which it is no longer the same game.
//!
//! ```
//! use std::sync::Arc;
//!
//! use bevy::prelude::*;
//! use bevy_playbot::{
//!     demo::{file::{Decider, DemoActions, DemoEpisode, EpisodeActions}, replay::ReplayDiverged},
//!     prelude::*,
//! };
//!
//! #[derive(Resource, Default)]
//! struct Heard(Vec<String>);
//!
//! // Three ticks of a game that paid nothing. A `DemoReader` gives out such episodes.
//! let mut episode = DemoEpisode::new(7, DemoActions::Discrete(2));
//! episode.actions = EpisodeActions::Discrete(vec![1, 0, 1]);
//! (episode.rewards, episode.state_hashes, episode.deciders) = (vec![0.0; 3], vec![0; 3], vec![Decider::Human; 3]);
//!
//! let mut app = headless_app();
//! app.init_resource::<Heard>()
//!     .add_observer(|event: On<ReplayDiverged>, mut heard: ResMut<Heard>| heard.0.push(event.divergence.to_string()))
//!     // Meanwhile the second tick pays a point.
//!     .add_systems(FixedUpdate, |mut agents: Query<(&Episode, &mut Reward)>| {
//!         agents.iter_mut().filter(|(episode, _)| episode.tick == 1).for_each(|(_, mut reward)| reward.add(1.0));
//!     });
//! let agent = app.world_mut().spawn(Agent::new(0, ActionSpace::Discrete(2))).id();
//! Replay::begin(Arc::new(episode), &mut app.world_mut().entity_mut(agent));
//! app.ticks(3).expect("no agent broke its contract");
//! assert!(app.world().get::<Replay>(agent).is_some_and(Replay::is_finished));
//! assert_eq!(app.world().resource::<Heard>().0, ["level 7, tick 1: the reward is 1, recorded was 0"]);
//! ```

use std::sync::Arc;

use bevy::prelude::*;
use thiserror::Error;

use super::file::{DemoEnd, DemoEpisode, EpisodeActions};
use crate::{
    action::{Action, ActionValue},
    control::Control,
    episode::{Episode, EpisodeEnd},
    level::LevelQueue,
    level_files::LevelFiles,
    reward::Reward,
    state_hash::StateHash,
    streams::AgentStreams,
};

/// The recorded episode that drives an agent under [`Control::Replay`].
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct Replay {
    episode: Arc<DemoEpisode>,
    divergence: Option<Divergence>,
    finished: bool,
    /// Whether a reward that is not the recorded one is a divergence.
    compares_rewards: bool,
}

/// A replay has stopped being the recorded game: triggered once in a replay, in the tick that differs.
#[derive(EntityEvent, Clone, Debug, PartialEq, Reflect)]
pub struct ReplayDiverged {
    /// The agent that replays.
    pub entity: Entity,
    /// Where, and what differs.
    pub divergence: Divergence,
}

/// Where a replay stopped being the recorded game.
#[derive(Clone, Debug, Error, PartialEq, Reflect)]
#[error("level {level}, tick {tick}: {what}")]
pub struct Divergence {
    /// The level.
    pub level: u64,
    /// The tick, from 0.
    pub tick: u32,
    /// What differs.
    pub what: String,
}

impl Replay {
    /// A replay of this episode. The agent's level queue must give the episode's level.
    pub fn new(episode: Arc<DemoEpisode>) -> Self {
        Self { episode, divergence: None, finished: false, compares_rewards: true }
    }

    /// A replay that takes what the game pays now, whatever was recorded, as long as the game is in the recorded states. If no
    /// state was ever hashed, rewards are all that tells one game from another, and are compared all the same.
    // Hidden: for playbot_lab.
    #[doc(hidden)]
    #[must_use]
    pub fn paid_anew(self) -> Self {
        let compares_rewards = self.episode.state_hashes.iter().all(|&hash| hash == 0);
        Self { compares_rewards, ..self }
    }

    /// Hands an agent over to this recording, from its first tick on: whatever it was playing is left at once. Where levels
    /// are files, the level is the one that the recorded file has now.
    pub fn begin(episode: Arc<DemoEpisode>, agent: &mut EntityWorldMut) {
        Self::new(episode).start(agent);
    }

    /// [`begin`](Self::begin) with this replay.
    // Hidden: for playbot_lab.
    #[doc(hidden)]
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

    /// The first difference between the recording and the game, if one has been met. [`ReplayDiverged`] announces it.
    pub fn divergence(&self) -> Option<&Divergence> {
        self.divergence.as_ref()
    }

    /// Whether the last recorded tick has been played, or the game ended before it.
    pub fn is_finished(&self) -> bool {
        self.finished
    }

    /// The recorded episode.
    pub fn episode(&self) -> &DemoEpisode {
        &self.episode
    }
}

/// The action of one tick of a recording.
// Hidden here and below: for playbot_lab, playbot_cli and tests; games need none of it.
#[doc(hidden)]
pub fn recorded_action(actions: &EpisodeActions, tick: usize) -> Option<ActionValue> {
    match actions {
        EpisodeActions::Discrete(list) => list.get(tick).map(|index| ActionValue::Discrete(*index)),
        EpisodeActions::Continuous { dim, values } => {
            values.get(tick * dim..(tick + 1) * dim).map(|row| ActionValue::Continuous(row.to_vec()))
        }
    }
}

pub(crate) fn run_replays(mut agents: Query<(&Control, &Episode, &mut Replay, &mut Action)>) {
    for (control, episode, mut replay, mut action) in &mut agents {
        if *control != Control::Replay || !episode.is_running() {
            continue;
        }
        match recorded_action(&replay.episode.actions, episode.tick as usize) {
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
        // Judge has counted this tick already.
        let tick = episode.tick.saturating_sub(1);
        let demo = &*replay.episode;
        // Of another level nothing else needs to be said.
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

/// Why the level is not the file that was recorded, if it is not.
fn other_level(demo: &DemoEpisode, level: u64, files: Option<&LevelFiles>) -> Option<String> {
    let recorded = demo.level_file.as_ref()?;
    match files {
        Some(files) => files.difference(level, recorded),
        None => Some(format!("recorded was the level file {recorded}, but the levels played here are no files")),
    }
}

/// What is not as recorded in this tick; the reward only if it is given.
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
            // An aborted recording says nothing about how the game would have gone on.
            DemoEnd::Aborted => end,
        }
    };
    if recorded_hash != hash {
        Some(format!("the state hash is {hash:08x}, recorded was {recorded_hash:08x}"))
    } else if let Some(reward) = reward.filter(|reward| reward.to_bits() != recorded_reward.to_bits()) {
        Some(format!("the reward is {reward}, recorded was {recorded_reward}"))
    } else if recorded_end != end {
        Some(format!("the episode's end is {end:?}, recorded was {recorded_end:?}"))
    } else {
        None
    }
}
