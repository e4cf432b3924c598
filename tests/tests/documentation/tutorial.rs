//! What the tutorial promises of its game is true.

use bevy_playbot::{bot::BlindBot, vision::ObservationConfig};
use playbot_lab::{
    doctor::{DoctorOptions, examine},
    eval::{EvalPlan, EvalSummary, Player, evaluate, summarize},
    prelude::*,
};

use super::runner::runner;

fn measure(player: &Player) -> EvalSummary {
    let split: LevelSplit = "default:64..83".parse().expect("a split");
    let plan = EvalPlan {
        split: split.clone(),
        observation_config: ObservationConfig::default(),
        episodes_per_level: 1,
        seed: 1,
        arenas: 4,
        worlds: 2,
        threads: 2,
    };
    summarize("player", &split, &evaluate(&runner(), player, &plan, |_| {}).expect("it can be played"))
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
