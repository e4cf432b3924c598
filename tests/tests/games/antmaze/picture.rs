//! Tests of the picture.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_playbot::vision::{ObservationConfig, ObservationKind};
use playbot::prelude::*;
use playbot_games::{ant::Ant, antmaze::AntMaze};
use playbot_harness::worlds::build_observing_world;

use super::arena::put;

#[test]
fn pictures_show_floor_walls_ant_and_goal() {
    let observation_config = ObservationConfig { kind: ObservationKind::Raster, ..ObservationConfig::default() };
    let (mut world, agents) =
        build_observing_world(&AntMaze, "umaze", &observation_config, 0, 0, 1).expect("can be drawn");
    let still = Action(ActionValue::Continuous(vec![0.0; 8]));
    world.entity_mut(agents[0]).insert((Control::Human, still, LevelQueue::Always(0)));
    world.tick().expect("sound");
    let colours = |world: &World| {
        let image = Arc::new(world.get::<Observation>(agents[0]).expect("an agent").image.clone());
        let plane = image.len() / 3;
        move |x: usize, y: usize| [0, 1, 2].map(|channel| image[channel * plane + 64 * y + x])
    };
    // 4 pixels to the metre, the ant in the middle, y up.
    let at = colours(&world);
    assert!(at(32, 32)[0] > at(32, 32)[2] + 60, "the ant is red");
    assert!(at(32 + 16, 32)[1] > 180, "the next cell is floor");
    assert!(at(32, 32 + 16)[2] < 110 && at(32 - 16, 32)[2] < 110, "walls on two sides");
    // One cell to the right of the goal.
    put(&mut world, agents[0], [4.0, 8.0, 0.6]);
    world.tick().expect("sound");
    let [red, green, blue] = colours(&world)(16, 32);
    assert!(green > red + 40 && green > blue + 40, "the goal is green");
}

#[test]
fn the_open_floor_is_drawn_around_its_ant() {
    let observation_config = ObservationConfig { kind: ObservationKind::Raster, ..ObservationConfig::default() };
    let (mut world, agents) = build_observing_world(&Ant, "goal", &observation_config, 0, 0, 2).expect("can be drawn");
    let still = Action(ActionValue::Continuous(vec![0.0; 8]));
    for &agent in &agents {
        world.entity_mut(agent).insert((Control::Human, still.clone(), LevelQueue::Always(0)));
    }
    world.tick().expect("sound");
    for &agent in &agents {
        let image = &world.get::<Observation>(agent).expect("an agent").image;
        let at = |x: usize, y: usize| [0, 1, 2].map(|channel| image[channel * 64 * 64 + 64 * y + x]);
        assert!(at(32, 32)[0] > at(32, 32)[2] + 60, "the ant is red");
        assert!([(2, 2), (60, 30), (30, 60)].iter().all(|&(x, y)| at(x, y)[1] > 180), "floor");
    }
}
