//! Tests of observations, rewards and ends of episodes.

use playbot::prelude::*;
use playbot_games::antmaze::{AntMaze, arena::MazeAnt, geometry::distance};

use super::arena::{ended, level, place, put, world_with};

#[test]
fn the_first_observation_is_the_reset_in_the_order_of_the_original() {
    let (mut world, agent) = world_with("large", 7);
    world.tick().expect("sound");
    let seen = &world.get::<Observation>(agent).expect("an agent").vector;
    let reset = level("large", 7).reset;
    let names = AntMaze.observation().names;
    assert_eq!((seen.len(), names.len()), (29, 29));
    for (index, name) in [
        (0, "x"),
        (2, "z"),
        (3, "quaternion w"),
        (7, "hip 1 angle"),
        (14, "ankle 4 angle"),
        (15, "velocity x"),
        (18, "spin x"),
        (28, "ankle 4 velocity"),
    ] {
        assert_eq!(names[index], name);
    }
    for (value, (expected, name)) in seen.iter().zip(reset.qpos.iter().chain(&reset.qvel).zip(&names)) {
        assert!((value - expected).abs() < 1e-4, "{name} is {value} and not {expected}");
    }
}

#[test]
fn rewards_follow_the_distance_after_the_tick() {
    for (mode, pay) in [
        ("medium", (|away: f32| -away) as fn(f32) -> f32),
        ("medium+dense=exp", |away| (-away).exp()),
        ("medium+sparse", |away| f32::from(u8::from(away <= 0.5))),
    ] {
        let (mut world, agent) = world_with(mode, 3);
        world.tick().expect("sound");
        for at in [[3.0, 0.0, 0.6], [20.0, 18.0, 0.6], [19.4, 20.0, 0.6]] {
            put(&mut world, agent, at);
            world.tick().expect("sound");
            let away = distance(place(&world, agent), [20.0, 20.0]);
            let reward = world.get::<Reward>(agent).expect("an agent").get();
            assert!((reward - pay(away)).abs() < 1e-6, "{mode}: {reward} at {away} m");
        }
    }
}

#[test]
fn an_ant_within_half_a_metre_of_the_goal_has_won() {
    for (mode, reward) in [("medium", -0.5..0.0), ("medium+sparse", 0.9..1.1)] {
        let (mut world, agent) = world_with(mode, 3);
        world.tick().expect("sound");
        put(&mut world, agent, [20.0, 19.2, 0.6]);
        world.tick().expect("sound");
        assert_eq!(ended(&world, agent), 0, "0.8 m are too far");
        put(&mut world, agent, [20.0, 19.8, 0.6]);
        world.tick().expect("sound");
        let count = *world.get::<EpisodeCount>(agent).expect("an agent");
        assert_eq!((count.finished, count.successes), (1, 1));
        assert!(reward.contains(&world.get::<Reward>(agent).expect("an agent").get()));
        world.tick().expect("sound");
        assert!(place(&world, agent).iter().all(|x| x.abs() < 1.0), "the next episode begins at the start");
    }
}

/// If every tick pays the more the nearer the goal is, reaching it must not end the episode.
#[test]
fn an_ant_that_is_paid_for_nearness_stays_at_the_goal() {
    let (mut world, agent) = world_with("medium+dense=exp+limit=20", 3);
    world.tick().expect("sound");
    for _ in 0..10 {
        put(&mut world, agent, [20.0, 19.8, 0.6]);
        world.tick().expect("sound");
        assert_eq!(ended(&world, agent), 0);
    }
    while ended(&world, agent) == 0 {
        world.tick().expect("sound");
    }
    let (episode, count) = (world.get::<Episode>(agent), world.get::<EpisodeCount>(agent));
    assert_eq!(episode.expect("an agent").tick, 20);
    assert_eq!(count.expect("an agent").successes, 1, "the goal was reached before time was up");
}

#[test]
fn only_the_clock_ends_what_the_goal_does_not() {
    let (mut world, agent) = world_with("medium+limit=30", 1);
    world.tick().expect("sound");
    // On its back, in the air.
    let mut state = level("medium", 1).reset;
    state.qpos[3..7].copy_from_slice(&[0.0, 1.0, 0.0, 0.0]);
    world.get_mut::<MazeAnt>(agent).expect("plays").0.set_state(&state);
    world.ticks(28).expect("sound");
    assert_eq!(ended(&world, agent), 0);
    world.tick().expect("sound");
    let count = *world.get::<EpisodeCount>(agent).expect("an agent");
    assert_eq!((count.finished, count.successes), (1, 0));
}

#[test]
fn an_ant_that_arrives_with_the_last_tick_has_arrived() {
    let (mut world, agent) = world_with("medium+limit=2", 1);
    world.tick().expect("sound");
    put(&mut world, agent, [20.0, 20.0, 0.6]);
    world.tick().expect("sound");
    assert_eq!(world.get::<EpisodeCount>(agent).expect("an agent").successes, 1);
}
