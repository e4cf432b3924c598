//! The takeovers `policy:FILE`, `replay:FILE` and `record:FILE`, and the former players of the agents.

use crate::{
    agent::{Agent, AgentOrder, Control},
    demo::{
        file::{DemoEpisode, DemoHeader, DemoReader, DemoWriter},
        recorder::{Recorder, Recording, flush_unfinished},
        replay::Replay,
    },
    episode::Episode,
    fault::Faults,
    level::LevelQueue,
    observation::VectorSensor,
    placement::{TickPlacement, TickSchedules},
    policy::{ActionDraw, AgentMemory},
    policy_file::{GameMetadata, check_policy, install_policy},
    skill_prior::ActiveSkill,
    streams::AgentStreams,
    takeover::{GameIdentity, TakeoverError},
};
use bevy::{prelude::*, time::TimeUpdateStrategy};
use playbot_learner::{DeviceKind, PolicyFile};
use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
    sync::Arc,
};

/// Hands the playing agents over to a policy, and returns the seats of their former players.
pub(super) fn start(world: &mut World, path: &Path) -> Result<Vec<Seat>, TakeoverError> {
    let agents = install(world, path)?;
    let seats: Vec<Seat> = agents.iter().filter_map(|&agent| Seat::of(world, agent)).collect();
    for agent in agents {
        world.entity_mut(agent).insert(Control::Policy);
        forget(world, agent);
    }
    Ok(seats)
}

/// Replaces the policy that plays by a newer one.
pub(super) fn reload(world: &mut World, path: &Path) -> Result<(), TakeoverError> {
    for agent in install(world, path)? {
        forget(world, agent);
    }
    Ok(())
}

/// Installs a policy, and returns the agents that play.
fn install(world: &mut World, path: &Path) -> Result<Vec<Entity>, TakeoverError> {
    let file = PolicyFile::load(path, DeviceKind::default())?;
    let agents = playing_agents(world);
    let mut games = agents.iter().filter_map(|&agent| metadata(world, agent));
    if let Some(why) = games.find_map(|metadata| check_policy(&metadata, &file).err()) {
        return Err(TakeoverError::Misfit { path: path.to_owned(), why: why.to_string() });
    }
    install_policy(world, &file, ActionDraw::default());
    Ok(agents)
}

/// Gives the agents back.
pub(super) fn stop(world: &mut World, seats: Vec<Seat>) {
    for seat in seats {
        forget(world, seat.agent);
        seat.give_back(world);
    }
}

/// Returns the metadata that a policy must match to play this agent. Names of actions are not known
/// here, and pictures are checked when the policy first reads one.
fn metadata(world: &World, agent: Entity) -> Option<GameMetadata<'_>> {
    let game = world.resource::<GameIdentity>();
    let names = world.get::<VectorSensor>(agent).map(|sensor| sensor.space().names.clone());
    Some(GameMetadata {
        name: &game.name,
        version: game.version,
        observations: names.unwrap_or_default(),
        actions: world.get::<Agent>(agent)?.actions,
        action_names: Vec::new(),
        has_picture: true,
    })
}

// Takeover `replay:FILE`.

/// A recording that plays.
#[derive(Debug)]
pub(super) struct Playing {
    path: PathBuf,
    seat: Seat,
    left: VecDeque<Arc<DemoEpisode>>,
    /// Episodes that were begun.
    begun: usize,
}

/// Hands the first playing agent over to a recording.
pub(super) fn start_replay(world: &mut World, path: &Path) -> Result<Option<Playing>, TakeoverError> {
    let game = world.resource::<GameIdentity>();
    let reader = DemoReader::open_for_game(path, &game.name, game.version, Some(&game.mode))?;
    let episodes = reader.read_all()?;
    let left: VecDeque<_> = episodes.into_iter().filter(|episode| !episode.is_empty()).map(Arc::new).collect();
    if left.is_empty() {
        return Err(TakeoverError::Empty { path: path.to_owned() });
    }
    let seat = playing_agents(world).first().and_then(|&agent| Seat::of(world, agent));
    let mut playing = seat.map(|seat| Playing { path: path.to_owned(), seat, left, begun: 0 });
    if let Some(playing) = &mut playing {
        playing.next(world);
    }
    Ok(playing)
}

impl Playing {
    /// Begins the next episode. Returns false if there is no next one.
    fn next(&mut self, world: &mut World) -> bool {
        let Some(episode) = self.left.pop_front() else { return false };
        self.begun += 1;
        let Ok(mut agent) = world.get_entity_mut(self.seat.agent) else { return false };
        Replay::begin(episode, &mut agent);
        true
    }

    /// Goes on to the next episode when this one is over. Returns false after the last one.
    pub fn go_on(&mut self, world: &mut World) -> bool {
        let Some(replay) = world.get::<Replay>(self.seat.agent) else { return false };
        if !replay.is_finished() {
            return true;
        }
        if let Some(divergence) = replay.divergence() {
            let what = format!(
                "{}: episode {} does not replay ({divergence}): the game differs from the recorded one",
                self.path.display(),
                self.begun - 1
            );
            world.resource_mut::<Faults>().report(what);
        }
        self.next(world)
    }

    /// Gives the agent back.
    pub fn stop(self, world: &mut World) {
        if let Ok(mut agent) = world.get_entity_mut(self.seat.agent) {
            agent.remove::<Replay>();
        }
        self.seat.give_back_anew(world);
    }
}

// Takeover `record:FILE`.

/// Name of the player, unless the environment names one.
const SOMEBODY: &str = "player";

/// Begins to record the playing agents. Their running episodes began too early: the recording
/// starts with their next episode.
pub(super) fn start_recording(world: &mut World, path: &Path) -> Result<(), TakeoverError> {
    if world.contains_resource::<Recorder>() {
        return Err(TakeoverError::Recording { path: path.to_owned() });
    }
    let agents = playing_agents(world);
    let Some(actions) = agents.first().and_then(|&agent| world.get::<Agent>(agent)).map(|agent| agent.actions) else {
        return Ok(());
    };
    let game = world.resource::<GameIdentity>();
    let header = DemoHeader {
        demonstrator: std::env::var("PLAYBOT_NAME").unwrap_or_else(|_| SOMEBODY.to_owned()),
        ..DemoHeader::new(&game.name, game.version, &game.mode, tick_hz(world), actions)
    };
    world.insert_resource(Recorder::new(DemoWriter::append_or_create(path, header)?));
    for agent in agents {
        // A file holds actions of one kind.
        if world.get::<Agent>(agent).is_some_and(|agent| agent.actions == actions) {
            world.entity_mut(agent).insert(Recording::default());
        }
    }
    Ok(())
}

/// Ends the recording. Unfinished episodes are kept as aborted.
pub(super) fn stop_recording(world: &mut World) -> Result<(), TakeoverError> {
    let flushed = flush_unfinished(world);
    world.remove_resource::<Recorder>();
    let mut recorded = world.query_filtered::<Entity, With<Recording>>();
    for agent in recorded.iter(world).collect::<Vec<_>>() {
        world.entity_mut(agent).remove::<Recording>();
    }
    Ok(flushed?)
}

/// Returns ticks per second of game time. A step has whole nanoseconds, so its inverse is not
/// exactly the requested rate.
fn tick_hz(world: &World) -> f64 {
    let is_frame = world.get_resource::<TickSchedules>().is_some_and(|ticks| ticks.placement == TickPlacement::Frame);
    let step = match world.get_resource::<TimeUpdateStrategy>() {
        Some(TimeUpdateStrategy::ManualDuration(frame)) if is_frame => frame.as_secs_f64(),
        _ => world.get_resource::<Time<Fixed>>().map_or(1.0 / 60.0, |time| time.timestep().as_secs_f64()),
    };
    (1000.0 / step).round() / 1000.0
}

// Former players of agents.

/// The state of an agent before a takeover.
#[derive(Clone, Debug)]
pub(super) struct Seat {
    pub agent: Entity,
    control: Control,
    levels: LevelQueue,
    streams: AgentStreams,
}

/// Returns the agents that are played, lowest number first.
pub(super) fn playing_agents(world: &World) -> Vec<Entity> {
    let agents = world.resource::<AgentOrder>().entities().iter().copied();
    agents.filter(|&agent| Control::of(world, agent).is_active()).collect()
}

impl Seat {
    /// Notes the player of an agent.
    pub fn of(world: &World, agent: Entity) -> Option<Self> {
        let control = *world.get::<Control>(agent)?;
        let (levels, streams) = (world.get::<LevelQueue>(agent)?.clone(), world.get::<AgentStreams>(agent)?.clone());
        Some(Self { agent, control, levels, streams })
    }

    /// Gives the seat back in the middle of the episode.
    pub fn give_back(self, world: &mut World) {
        if let Ok(mut agent) = world.get_entity_mut(self.agent) {
            agent.insert(self.control);
        }
    }

    /// Gives the seat back with a new episode: the former player did not play the last one.
    pub fn give_back_anew(self, world: &mut World) {
        let Ok(mut agent) = world.get_entity_mut(self.agent) else { return };
        if let Some(mut episode) = agent.get_mut::<Episode>() {
            episode.abandon();
        }
        agent.insert((self.control, self.levels, self.streams));
    }
}

/// Resets skill and memory: a skill that was drawn for another state does not fit this one, and another policy remembers
/// in other numbers.
pub(super) fn forget(world: &mut World, agent: Entity) {
    if let Some(mut skill) = world.get_mut::<ActiveSkill>(agent) {
        skill.ticks_left = 0;
    }
    if let Some(mut memory) = world.get_mut::<AgentMemory>(agent) {
        memory.0.clear();
    }
}
