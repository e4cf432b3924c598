//! Recordings of bots.

use std::path::Path;

use bevy::prelude::*;
use bevy_playbot::demo::file::{DemoHeader, DemoWriter};
use playbot::prelude::*;
use playbot_harness::worlds::build_world;

/// Records uniformly random actions on each of these levels, in a World with this seed.
pub fn record_random(game: &dyn Game, mode: &str, seed: u64, path: &Path, levels: impl IntoIterator<Item = u64>) {
    let (mut world, agents) = build_world(game, mode, seed, 0, 1);
    world.entity_mut(agents[0]).insert(BlindBot::Uniform);
    record(world, agents[0], game.demo_header(mode), path, levels);
}

/// Records the game's demonstrator, with noise, on each of these levels.
pub fn record_demonstrator(
    game: &dyn Game,
    mode: &str,
    noise: f64,
    path: &Path,
    levels: impl IntoIterator<Item = u64>,
) {
    let (mut world, agents) = build_world(game, mode, 5, 0, 1);
    game.tools().bots.attach_demonstrator(&mut world, agents[0], noise);
    record(world, agents[0], game.demo_header(mode), path, levels);
}

/// Records the bot of this agent on each of these levels, under any head.
pub fn record(mut world: World, agent: Entity, header: DemoHeader, path: &Path, levels: impl IntoIterator<Item = u64>) {
    world.insert_resource(Recorder::new(DemoWriter::create(path, header).expect("a fresh file")));
    let levels = LevelQueue::list(levels.into_iter().collect::<Vec<_>>());
    world.entity_mut(agent).insert((Control::Bot, Recording::default(), levels));
    while Control::of(&world, agent).is_active() {
        world.tick().expect("sound");
    }
    let finished = world.get::<EpisodeCount>(agent).expect("an agent").finished;
    assert_eq!(world.resource::<Recorder>().episodes(), finished, "each episode is recorded");
}
