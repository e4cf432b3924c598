//! One ant in one level.

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_games::antmaze::{
    AntMaze, AntMazeLevel,
    arena::{InMaze, MazeAnt},
    generate,
};
use playbot_harness::worlds::build_world;

pub fn level(mode: &str, seed: u64) -> AntMazeLevel {
    generate(&mode.parse().expect("a mode"), seed).expect("a level")
}

/// Returns a World with one agent in one level, without a decider.
pub fn world_with(mode: &str, seed: u64) -> (World, Entity) {
    let (mut world, agents) = build_world(&AntMaze, mode, 0, 0, 1);
    let still = Action(ActionValue::Continuous(vec![0.0; 8]));
    world.entity_mut(agents[0]).insert((Control::Human, still, LevelQueue::Always(seed)));
    (world, agents[0])
}

pub fn act(world: &mut World, agent: Entity, torques: [f32; 8]) {
    world.entity_mut(agent).insert(Action(ActionValue::Continuous(torques.to_vec())));
}

pub fn place(world: &World, agent: Entity) -> [f32; 2] {
    let state = world.get::<MazeAnt>(agent).expect("plays").0.state();
    [state.qpos[0], state.qpos[1]]
}

/// Puts the ant elsewhere, as it was at the start of its level.
pub fn put(world: &mut World, agent: Entity, place: [f32; 3]) {
    let mut state = world.get::<InMaze>(agent).expect("plays").0.reset;
    state.qpos[..3].copy_from_slice(&place);
    world.get_mut::<MazeAnt>(agent).expect("plays").0.set_state(&state);
}

pub fn ended(world: &World, agent: Entity) -> u64 {
    world.get::<EpisodeCount>(agent).expect("an agent").finished
}
