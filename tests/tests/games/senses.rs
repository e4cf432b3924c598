//! Tests of games with more observations: the same games, to the bit.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_playbot::{
    test_app::{PlaybotTestExt, test_app},
    vision::{ObservationConfig, ObservationKind},
};
use playbot::prelude::*;
use playbot_games::{
    antmaze::{AntMaze, AntMazeWithMap, AntMazeWithPositionalEncoding, AntMazeWithRays},
    maze2d::{Maze2d, Maze2dWithMap, Maze2dWithPositionalEncoding, Maze2dWithRays},
};
use playbot_harness::{
    parallel::on_threads,
    worlds::{add_game, build_observing_world, build_world, spawn_agents},
};

/// Longest episode, in ticks, in the modes of [`games`].
const LIMIT: u64 = 60;

/// Returns every game with more observations, their number of values, the same game without, and a mode.
fn games() -> [(Arc<dyn Game>, usize, Arc<dyn Game>, &'static str); 6] {
    let (ball, ant) = ("random+goal=random+limit=60", "random+goals=random+random-start+limit=60");
    [
        (Arc::new(Maze2dWithRays::default()), 10, Arc::new(Maze2d::default()), ball),
        (Arc::new(Maze2dWithMap::default()), 131, Arc::new(Maze2d::default()), ball),
        (Arc::new(Maze2dWithPositionalEncoding::default()), 16, Arc::new(Maze2d::default()), ball),
        (Arc::new(AntMazeWithRays::default()), 10, Arc::new(AntMaze), ant),
        (Arc::new(AntMazeWithMap::default()), 131, Arc::new(AntMaze), ant),
        (Arc::new(AntMazeWithPositionalEncoding::default()), 16, Arc::new(AntMaze), ant),
    ]
}

/// Returns two agents that push at random.
fn build(game: &dyn Game, mode: &str, observation_config: &ObservationConfig, first: u32) -> (World, Vec<Entity>) {
    let (mut world, agents) = build_observing_world(game, mode, observation_config, 3, first, 2).expect("can be drawn");
    for &agent in &agents {
        let levels = LevelQueue::Uniform { first: 0, last: 63 };
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, levels));
    }
    (world, agents)
}

#[test]
fn senses_change_nothing_in_the_game() {
    for (with_senses, more, without, mode) in games() {
        let mut pair = [&with_senses, &without].map(|game| build(&**game, mode, &ObservationConfig::default(), 0));
        let (all, own) = (with_senses.observation().len(), without.observation().len());
        assert_eq!((all, with_senses.version()), (own + more, without.version()));
        for tick in 0..150 {
            let [(seen, hashes), (plain, others)] = pair.each_mut().map(|(world, agents)| {
                world.tick().expect("sound");
                let vectors: Vec<_> = agents
                    .iter()
                    .map(|&agent| world.get::<Observation>(agent).expect("an agent").vector.clone())
                    .collect();
                let hashes: Vec<_> =
                    agents.iter().map(|&agent| world.get::<StateHash>(agent).map(|hash| hash.0)).collect();
                (vectors, hashes)
            });
            assert_eq!(hashes, others, "{}, tick {tick}", with_senses.name());
            for (seen, plain) in seen.iter().zip(&plain) {
                assert_eq!((seen.len(), &seen[..own]), (all, &plain[..]), "{}, tick {tick}", with_senses.name());
            }
        }
    }
}

#[test]
fn threads_change_nothing_that_is_seen() {
    for (game, _, _, mode) in games() {
        let seen = |threads| {
            let mut worlds = [0, 2].map(|first| build(&*game, mode, &ObservationConfig::default(), first));
            on_threads(&mut worlds, threads, |(world, agents)| {
                let mut seen = Vec::new();
                for _ in 0..120 {
                    world.tick().expect("sound");
                    let vectors = agents.iter().filter_map(|&agent| world.get::<Observation>(agent));
                    seen.extend(vectors.flat_map(|observation| observation.vector.iter().map(|value| value.to_bits())));
                }
                seen
            })
        };
        assert!(seen(1) == seen(2), "{}", game.name());
    }
}

#[test]
fn systems_are_in_one_order_with_pictures_and_without() {
    for (game, _, _, mode) in games() {
        for kind in [ObservationKind::Vector, ObservationKind::Raster] {
            let mut app = test_app();
            let observation_config = ObservationConfig { kind, ..ObservationConfig::default() };
            add_game(&*game, &mut app, mode, &observation_config, 1).expect("can be drawn");
            let agent = spawn_agents(&*game, app.world_mut(), &observation_config, 0, 1)[0];
            game.tools().bots.attach_demonstrator(app.world_mut(), agent, 0.2);
            app.world_mut().entity_mut(agent).insert(Control::Bot);
            app.play_episodes(2, 2 * LIMIT + 10).expect("sound");
            let vector = &app.world().get::<Observation>(agent).expect("an agent").vector;
            assert_eq!(vector.is_empty(), kind == ObservationKind::Raster, "pictures are all that their agents get");
        }
    }
}

#[test]
fn who_stands_at_the_goal_sees_no_way_left() {
    // Only the demonstrator gets there: the offset of the goal is the same by which episodes are judged.
    let goal = |game: &dyn Game| game.observation().names.iter().position(|name| name == "goal x");
    let who_see: Vec<_> = games().into_iter().filter_map(|(game, ..)| Some((goal(&*game)?, game))).collect();
    assert_eq!(who_see.len(), 4);
    for (at, game) in who_see {
        let (mut world, agents) = build_world(&*game, "umaze", 0, 0, 1);
        game.tools().bots.attach_demonstrator(&mut world, agents[0], 0.0);
        world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(0)));
        let mut left = f32::INFINITY;
        while world.get::<EpisodeCount>(agents[0]).expect("an agent").finished == 0 {
            world.tick().expect("sound");
            let vector = &world.get::<Observation>(agents[0]).expect("an agent").vector;
            left = left.min(Vec2::new(vector[at], vector[at + 1]).length());
        }
        assert!(left < 0.8, "{}: {left} m from the goal at the nearest", game.name());
    }
}
