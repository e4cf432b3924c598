//! The recorder of agents' episodes, under any control.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{demo::file::{DemoHeader, DemoReader, DemoWriter}, prelude::*};
//!
//! let folder = tempfile::tempdir().expect("a folder");
//! let path = folder.path().join("walk.demo");
//! let header = DemoHeader::new("walk", 1, "default", 60.0, ActionSpace::Discrete(2));
//! let mut app = headless_app();
//! app.insert_resource(Recorder::new(DemoWriter::create(&path, header)?))
//!     // The game: an episode is won after three ticks.
//!     .add_systems(FixedUpdate, |mut episodes: Query<&mut Episode>| {
//!         episodes.iter_mut().filter(|episode| episode.tick == 2).for_each(|mut episode| episode.terminate(true));
//!     });
//! let player = (Agent::new(0, ActionSpace::Discrete(2)), Control::Bot, BlindBot::Uniform);
//! app.world_mut().spawn((player, Recording::default()));
//! app.ticks(6).expect("no agent broke its contract");
//! let episodes = DemoReader::open(&path)?.read_all()?;
//! assert_eq!(episodes.iter().map(|episode| episode.len()).collect::<Vec<_>>(), [3, 3]);
//! # Ok::<(), bevy_playbot::demo::file::DemoFileError>(())
//! ```

use crate::{
    action::{Action, ActionValue, Actions},
    agent::{Agent, AgentOrder, Control},
    carry_over::{ReflectCarryComponent, ReflectCarryResource},
    demo::file::{Decider, DemoEnd, DemoEpisode, DemoFileError, DemoWriter},
    episode::{Episode, EpisodeEnd},
    fault::Faults,
    level::{LevelFiles, RandomisedValues},
    observation::Observation,
    reward::Reward,
    state_hash::StateHash,
};
use bevy::prelude::*;

/// The target of finished episodes. Insert it, and add [`Recording`] to the agents to be recorded.
///
/// Each episode is on disk as soon as it has ended.
#[derive(Resource, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component, CarryResource)]
pub struct Recorder {
    #[reflect(ignore)]
    writer: DemoWriter,
    keep_observations: bool,
    steps: u64,
    episodes: u64,
    limit: Option<u64>,
}

impl Recorder {
    /// Creates a recorder into `writer`; observations are kept if the file's header names them.
    pub fn new(writer: DemoWriter) -> Self {
        let keep_observations = !writer.header().observation_names.is_empty();
        Self { writer, keep_observations, steps: 0, episodes: 0, limit: None }
    }

    /// Ends the running episode as aborted once this many ticks are on disk, so that a recording has an exact size.
    pub fn with_step_limit(mut self, steps: u64) -> Self {
        self.limit = Some(steps);
        self
    }

    /// Ticks on disk.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Episodes on disk.
    pub fn episodes(&self) -> u64 {
        self.episodes
    }

    /// Returns whether the step limit has been reached.
    fn is_full(&self) -> bool {
        self.limit.is_some_and(|limit| self.steps >= limit)
    }

    fn push(&mut self, episode: &DemoEpisode) -> Result<(), DemoFileError> {
        self.writer.push(episode)?;
        self.steps += episode.len() as u64;
        self.episodes += 1;
        Ok(())
    }
}

/// The episode of this agent as recorded so far.
#[derive(Component, Default, Debug, Reflect)]
#[reflect(Component, CarryComponent)]
pub struct Recording {
    #[reflect(ignore)]
    episode: Option<DemoEpisode>,
}

pub(crate) fn decider(control: Control) -> Decider {
    match control {
        Control::Human => Decider::Human,
        Control::Bot => Decider::Bot,
        Control::Policy => Decider::Policy,
        Control::Replay => Decider::Replay,
        Control::Idle => Decider::Idle,
    }
}

pub(crate) fn push_action(actions: &mut Actions, action: &ActionValue) {
    // Actions that do not fit their space were reported before the game saw them.
    let _ = actions.push(action);
}

/// Appends this tick to each recorded agent's episode; an ended episode goes to disk.
pub fn record_ticks(
    recorder: Option<ResMut<Recorder>>,
    order: Res<AgentOrder>,
    files: Option<Res<LevelFiles>>,
    mut agents: Query<(&Agent, &Control, &Action, &Reward, &StateHash, &Observation, &Episode, &mut Recording)>,
    drawn: Query<&RandomisedValues>,
    mut faults: ResMut<Faults>,
) {
    let Some(mut recorder) = recorder else { return };
    for &entity in order.entities() {
        let Ok((agent, control, action, reward, hash, observation, episode, mut recording)) = agents.get_mut(entity)
        else {
            continue;
        };
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        if recorder.is_full() {
            continue;
        }
        if episode.tick == 1 {
            // A pending episode was abandoned.
            if let Some(pending) = recording.episode.take()
                && let Err(error) = recorder.push(&pending)
            {
                faults.report(error.to_string());
            }
            let mut demo = DemoEpisode::new(episode.level, agent.actions);
            demo.level_file = files.as_ref().and_then(|files| files.of(episode.level)).cloned();
            demo.randomised = drawn.get(entity).map(|drawn| drawn.0.clone()).unwrap_or_default();
            recording.episode = Some(demo);
        }
        // Without its first ticks an episode cannot be replayed, so recording waits for the next one.
        let Some(demo) = recording.episode.as_mut() else { continue };
        push_action(&mut demo.actions, &action.0);
        demo.rewards.push(reward.get());
        demo.state_hashes.push(hash.folded());
        demo.deciders.push(decider(*control));
        if recorder.keep_observations {
            demo.observations.extend_from_slice(&observation.vector);
        }
        let full = recorder.limit.is_some_and(|limit| recorder.steps + demo.len() as u64 >= limit);
        demo.end = match episode.end() {
            Some(EpisodeEnd::Terminated { success }) => DemoEnd::Terminated { success },
            Some(EpisodeEnd::Truncated) => DemoEnd::Truncated,
            None if full => DemoEnd::Aborted,
            None => continue,
        };
        if let Some(finished) = recording.episode.take()
            && let Err(error) = recorder.push(&finished)
        {
            faults.report(error.to_string());
        }
    }
}

/// Writes the unfinished episodes of a World, as aborted. Call it before a recording stops.
///
/// # Errors
///
/// The file could not be written.
pub fn flush_unfinished(world: &mut World) -> Result<(), DemoFileError> {
    let entities = world.resource::<AgentOrder>().entities().to_vec();
    for entity in entities {
        let episode = world.get_mut::<Recording>(entity).and_then(|mut recording| recording.episode.take());
        if let (Some(episode), Some(mut recorder)) = (episode, world.get_resource_mut::<Recorder>()) {
            recorder.push(&episode)?;
        }
    }
    Ok(())
}
