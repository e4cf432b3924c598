//! What the tutorial promises of its game is true.

use std::path::Path;

use playbot_lab::{
    doctor::{DoctorOptions, examine},
    eval::{EvalSummary, Player, evaluate, summarize},
    games::Games,
    pipeline,
    prelude::*,
    train::{Experiment, config_file::parse_experiment, default_experiment::default_experiment},
};
use playbot_learner::DeviceKind;
use playbot_tests::measuring::plan;

use super::runner::runner;

fn measure(player: &Player) -> EvalSummary {
    let plan = plan("default:64..83");
    summarize("player", &plan.split, &evaluate(&runner(), player, &plan, |_| {}).expect("it can be played"))
}

#[test]
fn the_game_is_sound() {
    let options = DoctorOptions { ticks: 200, ..DoctorOptions::new("default".to_owned()) };
    let report = examine(&runner(), &options, |_| {}).expect("the game has this mode");
    assert!(report.is_healthy(), "{report}");
}

#[test]
fn the_jumper_finishes_levels_that_a_bot_which_only_runs_does_not() {
    let jumper = measure(&Player::Demonstrator);
    assert_eq!((jumper.episodes, jumper.success), (20, 1.0), "{jumper:?}");
    let runs = measure(&Player::Blind(BlindBot::Constant(ActionValue::Discrete(1))));
    assert_eq!(runs.success, 0.0, "{runs:?}");
}

/// Its steps 3 and 4 by functions, from fewer recordings, in fewer steps.
#[test]
fn what_is_trained_finishes_levels_that_nobody_has_played() {
    let folder = tempfile::tempdir().expect("a folder");
    let demos = folder.path().join("jumper.demo");
    pipeline::record(&runner(), &"default:128..167".parse().expect("levels"), 0.02, &demos).expect("recorded");
    let (game, games) = (runner(), [&runner() as &dyn Game]);
    let usual = default_experiment(&Games::new(&games).expect("one game"));
    let usual = parse_experiment(&usual.text, Path::new(&*usual.origin)).expect("valid");
    let mut experiment = Experiment { demos: Some(demos), steps: 8192, arenas: 8, worlds: 2, ..usual };
    experiment.skills.epochs = 5;
    let skills = pipeline::learn_skills(&game, &experiment, DeviceKind::Flex, 2).expect("learned");
    let trainer = pipeline::train(&game, &experiment, Some(&skills), DeviceKind::Flex, 2, |_| {}).expect("trained");
    let trained = measure(&Player::of_file(&pipeline::policy(&game, &trainer), ActionDraw::Sample));
    let random = measure(&Player::Blind(BlindBot::Uniform));
    assert!(trained.success >= 0.7 && random.success <= 0.5, "{trained:?}\n{random:?}");
}
