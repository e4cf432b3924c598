//! The takeover `record:FILE`.

use std::path::Path;

use bevy::{prelude::*, time::TimeUpdateStrategy};

use super::{error::TakeoverError, identity::GameIdentity, seats::playing_agents};
use crate::{
    agent::Agent,
    demo::{
        file::{DemoHeader, DemoWriter},
        recorder::{Recorder, Recording, demo_actions, flush_unfinished},
    },
    placement::{TickPlacement, TickSchedules},
};

/// Name of the player, unless the environment names one.
const SOMEBODY: &str = "player";

/// Begins to record the playing agents. Their running episodes began too early: the recording
/// starts with their next episode.
pub(super) fn start(world: &mut World, path: &Path) -> Result<(), TakeoverError> {
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
        ..DemoHeader::new(&game.name, game.version, &game.mode, tick_hz(world), demo_actions(&actions))
    };
    let writer = if path.exists() { DemoWriter::append(path, &header)? } else { DemoWriter::create(path, header)? };
    world.insert_resource(Recorder::new(writer));
    for agent in agents {
        // A file holds actions of one kind.
        if world.get::<Agent>(agent).is_some_and(|agent| agent.actions == actions) {
            world.entity_mut(agent).insert(Recording::default());
        }
    }
    Ok(())
}

/// Ends the recording. Unfinished episodes are kept as aborted.
pub(super) fn stop(world: &mut World) -> Result<(), TakeoverError> {
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
