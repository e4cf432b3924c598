//! Tests of arenas as a whole.

use bevy::{prelude::*, sprite::Anchor};
use bevy_playbot::{
    engine::into_world,
    test_app::PlaybotTestExt,
    vision::{Stage, TileLayer},
};
use playbot::prelude::*;
use playbot_games::coinrun::{
    Body, CoinRun, Mode,
    components::{ArenaBody, Crate, Enemy, InArena, PlaysIn, Saw},
    generator::generate,
};
use playbot_harness::worlds::build_world;

use super::arena::{NOTHING, drawn, play, press};

#[test]
fn levels_come_and_go_without_a_trace() {
    let (mut app, agents) = drawn("hard", 3);
    for &agent in &agents {
        let queue = LevelQueue::list((0..6).collect::<Vec<_>>());
        let run = BlindBot::Constant(ActionValue::Discrete(8));
        app.world_mut().entity_mut(agent).insert((Control::Bot, run, queue));
    }
    app.play_episodes(6, 20_000).expect("sound");
    let world = app.world_mut();
    let expected: usize = 3 * (generate(Mode::Hard, 5).spawns.len() + 2);
    let drawn = world.query_filtered::<(), (Or<(With<Sprite>, With<TileLayer>)>, Without<Agent>)>().iter(world).len();
    let puffs: usize = world.query_filtered::<&Children, With<Enemy>>().iter(world).map(|puffs| puffs.len()).sum();
    let drawn = drawn - puffs;
    assert_eq!(drawn, expected, "the bodies of the last level, a backdrop and tiles for each arena");
    let children: usize = world.query::<(&Stage, &Children)>().iter(world).map(|(_, children)| children.len()).sum();
    assert_eq!(children, expected + 3, "and the players");
    let mut stages = world.query_filtered::<&Transform, With<Stage>>();
    let places: Vec<_> = stages.iter(world).map(|at| at.translation).collect();
    let apart = |a: Vec3, b: Vec3| (a - b).abs().max_element() >= 64.0 + 14.0;
    assert!((0..3).all(|i| (0..i).all(|j| apart(places[i], places[j]))), "{places:?}");
    let arenas: Vec<_> = agents.iter().map(|&agent| world.get::<PlaysIn>(agent).expect("a player").0).collect();
    arenas.into_iter().for_each(|arena| assert!(world.despawn(arena)));
    let left = world.query_filtered::<(), With<Anchor>>().iter(world).len();
    assert_eq!(left, 0, "an arena takes everything with it");
}

#[test]
fn a_game_may_add_a_saw_and_move_a_crate() {
    let (mut app, agents) = drawn("easy", 1);
    let (world, agent) = (app.world_mut(), agents[0]);
    play(world, agent, 0);
    press(world, agent, NOTHING, 2);
    let arena = world.get::<PlaysIn>(agent).expect("a player").0;
    let saw = world.spawn((Saw, ArenaBody(Body::block([3, 1])), InArena(arena))).id();
    let moved = world.query_filtered::<Entity, With<Crate>>().iter(world).next().expect("easy level 0 has crates");
    world.entity_mut(moved).insert(ArenaBody(Body::block([4, 7])));
    press(world, agent, NOTHING, 1);
    assert_eq!(world.get::<Transform>(saw).expect("drawn").translation.truncate(), Vec2::new(3.5, 1.5));
    assert_eq!(world.get::<Transform>(moved).expect("drawn").translation.truncate(), Vec2::new(4.5, 7.5));
}

#[test]
fn a_game_plays_the_same_with_a_picture_and_without() {
    let run = |mut world: World, agent: Entity| -> Vec<u64> {
        world.insert_resource(bevy_playbot::streams::PlaybotSeed(3));
        let queue = LevelQueue::list((0..4).collect::<Vec<_>>());
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, queue));
        let mut hash = |_| {
            world.tick().expect("sound");
            world.get::<StateHash>(agent).expect("an agent").0
        };
        (0..300).map(&mut hash).collect()
    };
    let (app, agents) = drawn("hard", 1);
    let (plain, plain_agents) = build_world(&CoinRun::default(), "hard", 0, 0, 1);
    assert_eq!(run(into_world(app), agents[0]), run(plain, plain_agents[0]));
}
