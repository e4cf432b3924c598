//! Tests of the example `lander`, from recording to policy file. The policy file plays in an app of `bevy_playbot`
//! alone.
#![allow(clippy::duplicate_mod, reason = "two examples share the rules of their game")]

#[path = "../../../plugin/cli/examples/lander.rs"]
#[allow(dead_code, reason = "its `main` is for those who run the example")]
mod lander_example;

#[path = "../../../plugin/examples/lander_window.rs"]
#[allow(dead_code, reason = "its `main` opens a window")]
mod lander_window;

use bevy::prelude::{App, ButtonInput, KeyCode};
use bevy_playbot::{
    engine::set_tick_rate,
    policy_file::{PolicyFile, check_policy, install_policy},
    prelude::*,
};
use playbot_harness::game::Game;
use playbot_learner::DeviceKind;

use lander_example::lander_rules::{TICK_HZ, add_rules, capsule};

/// As the example's, but small.
const TINY: &str = r#"(
    game: "lander", train: "moon:0..7", test: "moon:64..67", steps: 512, arenas: 4, worlds: 2,
    skills: (window: 5, latent: 2, epochs: 2, batch: 16, hidden: [8, 8], encoder_hidden: 8, gru_hidden: 8),
    ppo: (num_steps: 64, minibatches: 2, hidden: [8, 8]),
    score: (horizon: 5), eval: (episodes_per_level: 2),
)"#;

#[test]
fn the_lander_takes_all_steps() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("lander.policy");
    let [learned, random] = lander_example::all_steps(TINY, "moon:128..133", &path).expect("every step works");
    assert_eq!((learned.episodes, random.episodes), (8, 8));
    assert!(learned.return_mean.is_finite() && learned.length_mean > 1.0, "{learned:?}");

    let file = PolicyFile::load(&path, DeviceKind::default()).expect("written");
    check_policy(&lander_example::Lander.metadata(), &file).expect("made for this game");
    let mut app = headless_app();
    set_tick_rate(&mut app, TICK_HZ);
    add_rules(&mut app);
    let agent = app.world_mut().spawn((capsule(0), Control::Policy, LevelQueue::list([64, 65]))).id();
    install_policy(app.world_mut(), &file, ActionDraw::Sample);
    for _ in 0..1000 {
        app.tick().expect("the policy acts as the game allows");
    }
    let count = app.world().get::<EpisodeCount>(agent).expect("required by Agent");
    assert_eq!(count.finished, 2, "both levels are over after 401 ticks at most");
}

/// Returns the game of `lander_window` without its window: the policy that is part of the program plays.
fn shipped() -> App {
    let mut app = headless_app();
    set_tick_rate(&mut app, TICK_HZ);
    lander_window::lander_rules::add_rules(&mut app);
    lander_window::add_shipped_policy(&mut app).expect("made for these rules");
    app
}

#[test]
fn the_policy_that_is_shipped_lands_softly_on_levels_that_it_has_not_seen() {
    let mut app = shipped();
    let levels = LevelQueue::list((64..128).collect::<Vec<_>>());
    let capsule = lander_window::lander_rules::capsule(0);
    let agent = app.world_mut().spawn((capsule, Control::Policy, levels)).id();
    while app.world().get::<Control>(agent) != Some(&Control::Idle) {
        app.tick().expect("the policy acts as the game allows");
    }
    let count = *app.world().get::<EpisodeCount>(agent).expect("required by Agent");
    assert_eq!(count.finished, 64);
    assert!(count.successes > 51, "{} of 64 landings were soft", count.successes);
}

#[test]
fn f9_gives_the_controls_and_takes_them_back() {
    let mut app = shipped();
    // The first tick has a frame before it, which starts the clock.
    app.tick().expect("sound");
    let mut keys = ButtonInput::default();
    keys.press(KeyCode::F9);
    app.insert_resource(keys);
    let capsule = lander_window::lander_rules::capsule(0);
    let agent = app.world_mut().spawn((capsule, Control::Policy, LevelQueue::Always(64))).id();
    for wanted in [Control::Human, Control::Policy] {
        // The keys are not cleared here: it is pressed anew in every tick.
        app.tick().expect("sound");
        assert_eq!(app.world().get::<Control>(agent), Some(&wanted));
    }
}

/// The recordings of the experiment are good enough.
#[test]
fn the_pilot_lands_softly() {
    use playbot_harness::eval::Player;
    use playbot_train::{experiment::file::parse_experiment, pipeline};
    let experiment = parse_experiment(lander_example::EXPERIMENT, "lander.ron".as_ref()).expect("valid");
    let measured = pipeline::evaluate(&lander_example::Lander, &experiment, "pilot", &Player::Demonstrator, None, 2);
    let measured = measured.expect("the pilot can fly");
    assert!(measured.success > 0.9, "{measured:?}");
}
