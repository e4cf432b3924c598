//! Tests of recording, replaying, and recordings that do not fit.

use std::{path::Path, sync::Arc};

use bevy::prelude::*;
use bevy_playbot::{
    action::{ActionSpace, Actions},
    demo::{
        file::{Decider, DemoEnd, DemoHeader, DemoReader, DemoWriter, repair},
        replay::{Divergence, ReplayDiverged},
    },
    engine::flush_unfinished,
    vision::ObservationConfig,
};
use playbot::prelude::*;
use playbot_harness::{
    demo::{EpisodeReplayer, verify_file},
    worlds::build_world,
};
use playbot_tests::{Corridor, Drift, recording};
use playbot_train::demo::Demonstrations;

fn header() -> DemoHeader {
    Corridor.demo_header("plain")
}

/// Records a random walker for this many episodes.
fn record(path: &Path, header: DemoHeader, episodes: u64) {
    let (mut world, agents) = build_world(&Corridor, "plain", 5, 0, 1);
    world.entity_mut(agents[0]).insert(BlindBot::Uniform);
    recording::record(world, agents[0], header, path, 0..episodes);
}

#[test]
fn a_recording_replays_to_the_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("walk.demo");
    record(&path, header(), 30);
    let report = verify_file(&Corridor, &path, |_| {}).expect("readable");
    assert_eq!((report.episodes, report.divergences.len()), (30, 0));
    let episodes = DemoReader::open(&path).expect("readable").read_all().expect("whole");
    assert!(episodes.iter().all(|episode| episode.deciders.iter().all(|who| *who == Decider::Bot)));
    assert!(episodes.iter().any(|episode| episode.is_success()));
}

#[test]
fn a_nondeterministic_game_is_found_out_at_the_first_tick_that_differs() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("walk.demo");
    record(&path, header(), 1);
    let mut episode = DemoReader::open(&path).expect("readable").read_all().expect("whole").remove(0);
    episode.state_hashes[1] ^= 1;
    let mut replayer = EpisodeReplayer::new(&Corridor, "plain");
    let divergence = replayer.play(Arc::new(episode), |_, _| {}).expect("sound").expect("diverges");
    assert_eq!((divergence.level, divergence.tick), (0, 1));
    assert!(divergence.what.contains("state hash"), "{divergence}");
}

/// Divergences that were announced, with their agents.
#[derive(Resource, Default)]
struct Heard(Vec<(Entity, Divergence)>);

#[test]
fn hidden_randomness_in_the_game_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("walk.demo");
    record(&path, header(), 1);
    let episode = Arc::new(DemoReader::open(&path).expect("readable").read_all().expect("whole").remove(0));
    let (mut world, agents) = build_world(&Corridor, "plain", 0, 0, 1);
    world.insert_resource(Drift(1));
    world.init_resource::<Heard>();
    world.add_observer(|event: On<ReplayDiverged>, mut heard: ResMut<Heard>| {
        heard.0.push((event.entity, event.divergence.clone()));
    });
    world.entity_mut(agents[0]).insert((Control::Replay, LevelQueue::Always(episode.level_seed), Replay::new(episode)));
    world.tick().expect("sound");
    let divergence = world.get::<Replay>(agents[0]).and_then(Replay::divergence).expect("diverges").clone();
    assert_eq!(divergence.tick, 0);
    assert_eq!(world.resource::<Heard>().0, [(agents[0], divergence.clone())], "announced in its tick");
    world.tick().expect("sound");
    assert_eq!(world.resource::<Heard>().0.len(), 1, "said once");
}

#[test]
fn kept_observations_equal_those_of_a_replay() {
    let folder = tempfile::tempdir().expect("a folder");
    let (bare, full) = (folder.path().join("bare"), folder.path().join("full"));
    std::fs::create_dir_all(&bare).expect("writable");
    std::fs::create_dir_all(&full).expect("writable");
    record(&bare.join("walk.demo"), header(), 10);
    record(&full.join("walk.demo"), DemoHeader { observation_names: Corridor.observation().names, ..header() }, 10);
    let load = |path: &Path| {
        let demos = Demonstrations::read(&Corridor, &ObservationConfig::default(), path, None).expect("readable");
        demos.dataset(&Corridor, 2, |_| {}).expect("replays")
    };
    assert_eq!(load(&bare), load(&full));
}

#[test]
fn held_out_levels_are_not_learned_from() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("walk.demo");
    record(&path, header(), 10);
    let load = |held_out: &str| {
        Demonstrations::read(&Corridor, &ObservationConfig::default(), &path, Some(&held_out.parse().expect("a split")))
    };
    let error = load("plain:7..15").expect_err("level 7 is recorded").to_string();
    for words in ["walk.demo", "level 7", "plain:7..15", "`test`"] {
        assert!(error.contains(words), "{error}");
    }
    assert!(load("other:0..15").is_ok() && load("plain:60..70").is_ok(), "other levels");
}

#[test]
fn recordings_of_another_game_or_version_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, other, words) in [
        ("game", DemoHeader { game: "maze".into(), ..header() }, "`maze`, not of `corridor`"),
        ("version", DemoHeader { game_version: 2, ..header() }, "version 2 of `corridor`, but this is version 3"),
    ] {
        let path = folder.path().join(name);
        record(&path, other, 1);
        let error = verify_file(&Corridor, &path, |_| {}).expect_err("foreign").to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn what_breaks_the_game_is_named_with_its_file_and_episode() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, path) = (folder.path().join("whole.demo"), folder.path().join("walk.demo"));
    record(&whole, header(), 5);
    // Of a game that had more actions.
    let header = DemoHeader { actions: ActionSpace::Discrete(10), ..header() };
    let mut writer = DemoWriter::create(&path, header).expect("fresh");
    let episodes = DemoReader::open(&whole).expect("readable").read_all().expect("whole");
    for (index, mut episode) in episodes.into_iter().enumerate() {
        if index == 3
            && let Actions::Discrete(actions) = &mut episode.actions
        {
            actions[0] = 9;
        }
        writer.push(&episode).expect("writable");
    }
    let error = verify_file(&Corridor, &path, |_| {}).expect_err("no such action").to_string();
    assert!(error.contains("walk.demo, episode 3: ") && error.contains("action 9"), "{error}");
    let demos = Demonstrations::read(&Corridor, &ObservationConfig::default(), &path, None).expect("readable");
    let error = demos.dataset(&Corridor, 1, |_| {}).expect_err("no such action").to_string();
    assert!(error.contains("walk.demo, episodes 0, 1, 2, 3, 4: ") && error.contains("action 9"), "{error}");
}

#[test]
fn a_torn_recording_loses_its_last_episode_only() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, mended) = (folder.path().join("walk.demo"), folder.path().join("mended.demo"));
    record(&path, header(), 5);
    let bytes = std::fs::read(&path).expect("readable");
    std::fs::write(&path, &bytes[..bytes.len() - 3]).expect("writable");
    let error = verify_file(&Corridor, &path, |_| {}).expect_err("torn").to_string();
    assert!(error.contains("playbot demo repair"), "{error}");
    assert_eq!(repair(&path, &mended, None).expect("repairable").kept_episodes, 4);
    assert_eq!(verify_file(&Corridor, &mended, |_| {}).expect("whole").divergences.len(), 0);
}

#[test]
fn a_recording_has_exactly_the_steps_that_were_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("walk.demo");
    let (mut world, agents) = build_world(&Corridor, "plain", 5, 0, 1);
    world.insert_resource(Recorder::new(DemoWriter::create(&path, header()).expect("fresh")).with_step_limit(27));
    world.entity_mut(agents[0]).insert((
        Control::Bot,
        BlindBot::Constant(ActionValue::Discrete(2)),
        Recording::default(),
    ));
    while world.resource::<Recorder>().steps() < 27 {
        world.tick().expect("sound");
    }
    flush_unfinished(&mut world).expect("writable");
    let episodes = DemoReader::open(&path).expect("readable").read_all().expect("whole");
    let lengths: Vec<_> = episodes.iter().map(|episode| (episode.len(), episode.end)).collect();
    assert_eq!(lengths, [(20, DemoEnd::Truncated), (7, DemoEnd::Aborted)]);
}
