//! The replay of a path, alone: for recordings and for pictures.

use bevy::prelude::*;
use bevy_playbot::{
    action::Action,
    control::Control,
    demo::{
        file::DemoWriter,
        recorder::{Recorder, Recording, flush_unfinished},
    },
    episode::{Episode, EpisodeCount},
    fault::Fault,
    headless::tick_world,
    level::LevelQueue,
    streams::AgentStreams,
};
use playbot_learner::Actions;

use super::error::ExploreError;
use crate::{game::Game, worlds::build_world};

/// Plays actions on a level under the recorder. An episode that goes on after them is recorded as aborted. A replay of
/// the recording, for instance with [`verify_file`](crate::demo::verify::verify_file), checks that the path is the
/// same.
///
/// # Errors
///
/// The game broke its contract, or the recording cannot be written.
pub fn record_route(
    game: &dyn Game,
    mode: &str,
    level: u64,
    actions: &Actions,
    writer: DemoWriter,
) -> Result<(), ExploreError> {
    let (mut world, agent) = world_of(game, mode, level);
    world.insert_resource(Recorder::new(writer));
    world.entity_mut(agent).insert(Recording::default());
    play(&mut world, agent, actions, |_| {})?;
    flush_unfinished(&mut world)?;
    Ok(())
}

/// Returns the position of an agent after each tick of these actions, on the game's floor plan. Empty if the game does
/// not report positions.
///
/// # Errors
///
/// The game broke its contract.
pub fn follow_route(game: &dyn Game, mode: &str, level: u64, actions: &Actions) -> Result<Vec<Vec2>, Fault> {
    let (mut world, agent) = world_of(game, mode, level);
    let mut places = Vec::new();
    play(&mut world, agent, actions, |world| places.extend(game.tools().state.position(world, agent)))?;
    Ok(places)
}

/// Builds a World with an agent that plays the level once.
fn world_of(game: &dyn Game, mode: &str, level: u64) -> (World, Entity) {
    let (mut world, agents) = build_world(game, mode, 0, 0, 1);
    let agent = agents[0];
    world.entity_mut(agent).insert((Control::Bot, LevelQueue::list([level]), AgentStreams::new(0, 0)));
    (world, agent)
}

/// Plays the actions, or those up to the end of the episode.
fn play(world: &mut World, agent: Entity, actions: &Actions, mut after_tick: impl FnMut(&World)) -> Result<(), Fault> {
    let mut ticks = 0;
    while let Some(action) = actions.get(ticks) {
        world.entity_mut(agent).insert(Action(action));
        tick_world(world)?;
        let is_over = world.get::<EpisodeCount>(agent).is_some_and(|count| count.finished > 0);
        let played = world.get::<Episode>(agent).map_or(0, |episode| episode.tick as usize);
        // Levels that are still loading have no tick.
        if is_over || played != ticks {
            after_tick(world);
        }
        if is_over {
            break;
        }
        ticks = played;
    }
    Ok(())
}
