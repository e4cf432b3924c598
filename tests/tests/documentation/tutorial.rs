//! What the tutorial promises of its game is true.

use playbot_lab::{
    doctor::{DoctorOptions, examine},
    eval::{EvalSummary, Player, evaluate, summarize},
    prelude::*,
};
use playbot_tests::measuring::plan;

use super::runner::runner;

fn measure(player: &Player) -> EvalSummary {
    let plan = plan("default:64..83");
    summarize("player", &plan.split, &evaluate(&runner(), player, &plan, |_| {}).expect("it can be played"))
}

#[test]
fn the_game_is_sound() {
    let options = DoctorOptions { ticks: 200, several_arenas: false, ..DoctorOptions::new("default".to_owned()) };
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
