//! Tests of impossible actions and positions.

use bevy::prelude::*;
use playbot::prelude::*;

use super::arena::{act, put, world_with};

#[test]
fn actions_outside_the_range_are_clipped_and_counted() {
    #[derive(Resource, Default)]
    struct Clipped(Vec<u32>);
    let play = |torque: f32| {
        let (mut world, agent) = world_with("medium+limit=20", 5);
        world.init_resource::<Clipped>();
        world.add_observer(|event: On<EpisodeEnded>, mut clipped: ResMut<Clipped>| clipped.0.push(event.clipped));
        world.ticks(10).expect("sound");
        act(&mut world, agent, [torque, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -torque]);
        world.ticks(10).expect("sound");
        (world.get::<StateHash>(agent).expect("an agent").0, world.resource::<Clipped>().0.clone())
    };
    let (within, beyond) = (play(1.0), play(7.5));
    assert_eq!(within.0, beyond.0, "clipped to the range");
    assert_eq!((within.1, beyond.1), (vec![0], vec![10]));
}

#[test]
fn nan_in_an_action_names_agent_level_and_tick() {
    let (mut world, agent) = world_with("medium", 8);
    world.ticks(3).expect("sound");
    act(&mut world, agent, [0.0, f32::NAN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let fault = world.tick().expect_err("no number").to_string();
    for part in ["agent 0", "level 8", "tick 3", "NaN at index 1"] {
        assert!(fault.contains(part), "{part} is missing in: {fault}");
    }
}

#[test]
fn an_ant_that_has_left_the_world_is_reported_and_let_alone() {
    for place in [[-9.0, 0.0, 0.6], [0.0, 60.0, 0.6], [0.0, 0.0, 50.0]] {
        let (mut world, agent) = world_with("medium", 8);
        world.ticks(3).expect("sound");
        put(&mut world, agent, place);
        let fault = world.tick().expect_err("outside").to_string();
        for part in ["agent 0", "level 8", "tick 3", "outside the maze"] {
            assert!(fault.contains(part), "{part} is missing in: {fault}");
        }
        world.ticks(3).expect("stopped");
    }
}
