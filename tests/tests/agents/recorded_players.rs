//! Tests of recordings of any player, with noise.

use std::path::Path;

use bevy_playbot::{
    action::Actions,
    bot::BlindBot,
    demo::file::{Decider, DemoEpisode, DemoReader, DemoWriter},
    prelude::*,
    vision::ObservationConfig,
};
use playbot_harness::{
    demo::{demonstration::DemonstrationPlan, verify_file},
    eval::Player,
};
use playbot_tests::Corridor;

/// Records a bot that always does `action` on forty levels, with this noise.
fn recorded(path: &Path, action: u32, noise: f64, seed: u64) -> Vec<DemoEpisode> {
    let levels = (0..40).collect();
    let plan = DemonstrationPlan {
        mode: "plain".to_owned(),
        levels,
        noise,
        seed,
        steps: None,
        keep_observations: false,
        randomise: Default::default(),
    };
    let writer = DemoWriter::create(path, plan.header(&Corridor)).expect("a fresh file");
    let player = Player::Blind(BlindBot::Constant(ActionValue::Discrete(action)));
    let built = plan.build_world_of(&Corridor, &player, &ObservationConfig::default(), writer);
    let (mut world, agent) = built.expect("vectors need nothing");
    while Control::of(&world, agent).is_active() {
        world.tick().expect("sound");
    }
    let episodes = DemoReader::open(path).expect("a recording").map(|episode| episode.expect("whole"));
    episodes.collect()
}

/// Returns the share of other actions than this.
fn others(episodes: &[DemoEpisode], action: u32) -> f64 {
    let actions = episodes.iter().flat_map(|episode| match &episode.actions {
        Actions::Discrete(list) => list.clone(),
        Actions::Continuous { .. } | Actions::Mixed { .. } => Vec::new(),
    });
    let (all, other) = actions.fold((0.0, 0.0), |(all, other), it| (all + 1.0, other + f64::from(it != action)));
    other / all
}

#[test]
fn a_bot_is_recorded_as_it_plays() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("right.demo");
    let episodes = recorded(&path, 1, 0.0, 1);
    assert_eq!((episodes.len(), others(&episodes, 1)), (40, 0.0));
    assert!(episodes.iter().all(|episode| episode.deciders.iter().all(|decider| *decider == Decider::Bot)));
}

#[test]
fn noise_replaces_its_share_of_the_actions_and_is_what_the_game_hears() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let noisy = recorded(&path("a.demo"), 1, 0.6, 1);
    // Of the actions that are replaced a third is the same again.
    let share = others(&noisy, 1);
    assert!((0.25..0.55).contains(&share), "{share}");
    verify_file(&Corridor, &path("a.demo"), |_| {}).expect("what is recorded is what was played");
    recorded(&path("b.demo"), 1, 0.6, 1);
    recorded(&path("c.demo"), 1, 0.6, 2);
    let bytes = |name: &str| std::fs::read(path(name)).expect("readable");
    assert!(bytes("a.demo") == bytes("b.demo"), "the same seed");
    assert!(bytes("a.demo") != bytes("c.demo"), "another seed");
}
