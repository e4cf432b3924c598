//! Tests of the verbs through the command line.

use playbot_shell::{GameProgram, Shell, ended};

const GAME: GameProgram = GameProgram {
    program: env!("CARGO_BIN_EXE_foreign_breakout"),
    folder: env!("CARGO_MANIFEST_DIR"),
    game: "breakout",
    demonstrator: "follower",
    key: "Left",
    recorded: 1000,
    held_out: "default:100000..100001",
    recorded_ticks: Some("300"),
};

playbot_shell::tests!(GAME);
playbot_shell::tests!(
    GAME:
    defects_need_levels,
    planted_defects_are_scored,
);

#[cfg(feature = "screen")]
playbot_shell::tests!(GAME: a_window_learns_while_one_plays);
playbot_shell::tests!(GAME: a_lesson_is_given_and_goes_on);

/// The sound has a stand-in, so its file is not looked for.
#[test]
fn no_file_is_missed() {
    let shell = Shell::new(GAME.program);
    let (_, messages) = ended(shell.command(&["doctor", "breakout", "--ticks", "60"]), 0);
    assert!(!messages.contains("ERROR"), "{messages}");
}

/// A training would refuse it as well.
#[test]
fn an_experiment_that_asks_for_pictures_which_there_are_none_of_is_not_shown() {
    let shell = Shell::new(GAME.program);
    let own = format!("{}/experiment.ron", GAME.folder);
    let show = ["config", "show", "--experiment", &own, "--set", "skills.norm_obs=false"];
    ended(shell.command(&show), 0);
    let (shown, messages) = ended(shell.command(&[&show[..], &["--set", "observation=Raster"]].concat()), 3);
    assert!(messages.contains("`observation=Raster`: ") && messages.contains("breakout cannot be drawn"), "{messages}");
    assert_eq!(shown, "");
}
