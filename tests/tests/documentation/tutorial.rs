//! Tests of the tutorials' promises about their games.

use std::{panic::catch_unwind, path::Path};

use bevy::prelude::{Res, ResMut};
use playbot::prelude::*;
use playbot_harness::{
    doctor::{DoctorOptions, examine},
    eval::{EvalSummary, Player, evaluate, summarize},
    foreign::{ForeignGame, LevelSeed},
    games::Games,
};
use playbot_learner::DeviceKind;
use playbot_tests::measuring::plan;
use playbot_train::{
    Experiment,
    experiment::{default_experiment, file::parse_experiment},
    pipeline,
    run_observer::Unobserved,
    train_run::TrainingSetup,
};

use super::{
    blocks::read,
    hand_made::{self, PITS, Pit},
    runner::runner,
    sources::between_markers,
};

fn measure(player: &Player, levels: &str) -> EvalSummary {
    let plan = plan(levels);
    summarize("player", &plan.split, &evaluate(&runner(), player, &plan, |_| {}).expect("it can be played"))
}

#[test]
fn the_games_are_deterministic() {
    for game in [runner(), hand_made::runner()] {
        let options = DoctorOptions { ticks: 200, ..DoctorOptions::new("default".to_owned()) };
        let report = examine(&game, &options, |_| {}).expect("the game has this mode");
        assert!(report.is_healthy(), "{report}");
    }
}

/// The test of the first tutorial, which fails.
mod red {
    use super::{super::hand_made::runner, *};

    fn every_level_can_be_finished() {
        playbot::test(&runner()).levels("default:0..7").assert_levels_solvable();
    }

    #[test]
    fn it_fails_on_level_4_with_the_message_that_is_shown() {
        let panic = catch_unwind(every_level_can_be_finished).expect_err("level 4 cannot be finished");
        let message = panic.downcast_ref::<String>().expect("a message in words");
        let shown = between_markers("docs/tutorial/test-your-levels.md", "red-message");
        for line in shown.lines() {
            assert!(message.contains(line), "{line:?} is not in {message}");
        }
    }
}

/// Returns the repair of the first tutorial: another end of the pit of level 4.
fn repaired() -> ForeignGame {
    hand_made::runner().level(|level: Res<LevelSeed>, mut pit: ResMut<Pit>| {
        pit.0 = if level.0 == 4 { [4.0, 5.5] } else { PITS[level.0 as usize] };
    })
}

#[test]
fn the_repair_that_is_shown_makes_all_levels_solvable() {
    assert!(read("docs/tutorial/test-your-levels.md").contains("| `[4.0, 7.5]` | `[4.0, 5.5]` |"));
    assert_eq!(PITS[4], [4.0, 7.5]);
    playbot::test(&repaired()).levels("default:0..7").assert_levels_solvable();
    playbot::test(&repaired()).levels("default:0..7").assert_no_findings();
}

#[test]
fn the_jumper_finishes_levels_that_a_bot_which_only_runs_does_not() {
    let jumper = measure(&Player::Demonstrator, "default:64..83");
    assert_eq!((jumper.episodes, jumper.success), (20, 1.0), "{jumper:?}");
    let runs = measure(&Player::Blind(BlindBot::Constant(ActionValue::Discrete(1))), "default:64..83");
    assert_eq!(runs.success, 0.0, "{runs:?}");
}

/// Its steps 3 and 4 by functions, from fewer recordings, in fewer steps.
#[test]
fn the_trained_bot_finishes_more_unplayed_levels_than_random_keys() {
    let folder = tempfile::tempdir().expect("a folder");
    let demos = folder.path().join("jumper.demo");
    pipeline::record(&runner(), &"default:128..167".parse().expect("levels"), 0.02, &demos).expect("recorded");
    let (game, games) = (runner(), [&runner() as &dyn Game]);
    let default = default_experiment(&Games::new(&games).expect("one game"));
    let default = parse_experiment(&default.text, Path::new(&*default.origin)).expect("valid");
    let mut experiment = Experiment { demos: Some(demos), steps: 8192, arenas: 8, worlds: 2, ..default };
    experiment.skills.epochs = 5;
    let (file, run) = (folder.path().join("skills.safetensors"), folder.path().join("run"));
    let setup = TrainingSetup::new(DeviceKind::Flex, 2);
    let skills = pipeline::learn_skills(&game, &experiment, &file, &setup, &mut Unobserved).expect("learned");
    let with_file = Some((file.as_path(), &skills));
    let trainer = pipeline::train(&game, &experiment, with_file, &run, &setup, &mut Unobserved).expect("trained");
    let levels = "default:64..263";
    let trained = measure(&Player::of_file(&pipeline::policy(&game, &trainer), ActionDraw::Sample), levels);
    let random = measure(&Player::Blind(BlindBot::Uniform), levels);
    // So few steps teach little. Each share has a standard error of 0.035.
    assert!(trained.success > random.success + 0.05, "{} of the trained bot, {}", trained.success, random.success);
}
