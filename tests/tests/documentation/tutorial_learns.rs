//! The runner of the tutorial learns, by the tutorial's steps: small networks, and a small part of the experience.

use bevy_playbot::{bot::BlindBot, policy::ActionDraw};
use playbot_lab::{
    eval::Player,
    pipeline,
    train::{Experiment, config_file::parse_experiment},
};
use playbot_learner::DeviceKind;

use super::runner::runner;

const SMALL: &str = r#"(
    game: "runner", train: "default:0..63", test: "default:64..95", steps: 8192, arenas: 8, worlds: 2,
    skills: (window: 5, latent: 2, epochs: 20, batch: 64, norm_obs: true, action_noise: 0.1, hidden: [32, 32], encoder_hidden: 32, gru_hidden: 32),
    ppo: (num_steps: 128, minibatches: 4, hidden: [32, 32]),
    score: (horizon: 5), eval: (episodes_per_level: 2),
)"#;

#[test]
fn the_runner_learns_to_finish_levels_that_it_has_not_seen() {
    let (folder, device, threads) = (tempfile::tempdir().expect("a folder"), DeviceKind::default(), 2);
    let demos = folder.path().join("jumper.demo");
    let experiment = parse_experiment(SMALL, "small.ron".as_ref()).expect("valid");
    let experiment = Experiment { demos: Some(demos.clone()), ..experiment };
    let game = runner();

    let levels = "default:128..177".parse().expect("levels");
    assert_eq!(pipeline::record(&game, &levels, 0.1, &demos).expect("the jumper plays"), 50);
    let skills = pipeline::learn_skills(&game, &experiment, device, threads).expect("they replay");
    let trainer = pipeline::train(&game, &experiment, Some(&skills), device, threads, |_| {}).expect("it learns");
    let policy = Player::of_file(&pipeline::policy(&game, &trainer), ActionDraw::Greedy);

    let success = |name, player: &Player| {
        pipeline::evaluate(&game, &experiment, name, player, threads).expect("it plays").success
    };
    let learned = success("SCORE-PPO", &policy);
    let random = success("random", &Player::Blind(BlindBot::Uniform));
    assert!(learned > 0.8 && learned > random + 0.2, "learned {learned}, random {random}");
}
