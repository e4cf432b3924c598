//! Tests of determinism.

use bevy::prelude::*;
use bevy_playbot::{demo::file::DemoReader, test_app::PlaybotTestExt};
use playbot::prelude::*;
use playbot_games::antmaze::AntMaze;
use playbot_harness::{demo::verify_file, parallel::on_threads, worlds::build_world};
use playbot_tests::recording::record_random;

use super::arena::{act, world_with};

/// Returns the state hashes of each agent's whole episodes, agent by agent.
fn traces(worlds: &mut [(World, Vec<Entity>)], threads: usize, ticks: u32) -> Vec<Vec<u64>> {
    let played = on_threads(worlds, threads, |(world, agents)| {
        let mut traces = vec![Vec::new(); agents.len()];
        for _ in 0..ticks {
            world.tick().expect("sound");
            for (trace, &agent) in traces.iter_mut().zip(&*agents) {
                trace.push(world.get::<StateHash>(agent).expect("an agent").0);
            }
        }
        traces
    });
    played.into_iter().flatten().collect()
}

fn stage(first: u32, count: u32) -> (World, Vec<Entity>) {
    let (mut world, agents) = build_world(&AntMaze, "random+limit=600", 11, first, count);
    for &agent in &agents {
        let levels = LevelQueue::Uniform { first: 0, last: 63 };
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, levels));
    }
    (world, agents)
}

#[test]
fn threads_and_neighbours_change_no_bit_in_100_000_physics_steps() {
    // 8 arenas, 2500 control steps, 5 physics steps each.
    let apart = |threads| traces(&mut [stage(0, 4), stage(4, 4)], threads, 2500);
    let (one, two) = (apart(1), apart(2));
    assert!(one == two, "two threads are one thread");
    let together = traces(&mut [stage(0, 8)], 1, 300);
    for (apart, together) in one.iter().zip(&together) {
        assert!(apart[..300] == together[..], "an arena does not depend on who shares its World");
    }
    assert!(one[0] != one[1], "agents play levels of their own");
}

#[test]
fn a_level_is_the_same_whatever_was_played_before_it() {
    let play = |before: &[u64]| {
        let (mut world, agent) = world_with("medium+limit=40", 0);
        for &seed in before.iter().chain(&[6]) {
            world.entity_mut(agent).insert(LevelQueue::Always(seed));
            world.get_mut::<Episode>(agent).expect("an agent").abandon();
            act(&mut world, agent, [0.9, -0.4, 0.7, 1.0, -1.0, 0.2, -0.8, 0.5]);
            world.ticks(25).expect("sound");
        }
        world.get::<StateHash>(agent).expect("an agent").0
    };
    assert_eq!(play(&[]), play(&[1, 2, 3]));
}

#[test]
fn a_recording_replays_to_the_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("ant.demo");
    let mode = "medium+goals=demo+goal-noise=d4rl+random-start+limit=60";
    record_random(&AntMaze, mode, 5, &path, [4, 9, 4]);
    let report = verify_file(&AntMaze, &path, |_| {}).expect("readable");
    assert_eq!((report.episodes, report.divergences.len()), (3, 0));
    let episodes = DemoReader::open(&path).expect("readable").read_all().expect("whole");
    let hashes: Vec<_> = episodes.iter().map(|episode| episode.state_hashes.clone()).collect();
    assert_eq!(hashes[0].len(), 60);
    assert_ne!(hashes[0], hashes[2], "other actions, other states");
}

#[test]
fn systems_are_in_no_ambiguous_order() {
    let mut app = bevy_playbot::test_app::test_app();
    AntMaze.build(&mut app, "umaze+limit=10");
    AntMaze.tools().pictures.build_picture(&mut app);
    app.init_resource::<ButtonInput<KeyCode>>();
    let agent = AntMaze.spawn_agent(app.world_mut(), 0);
    AntMaze.tools().bots.attach_demonstrator(app.world_mut(), agent, 0.2);
    app.world_mut().entity_mut(agent).insert(Control::Bot);
    app.play_episodes(2, 40).expect("sound");
}
