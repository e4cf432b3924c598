//! Tests of the verbs through the command line.

use playbot_shell::GameProgram;

const GAME: GameProgram = GameProgram {
    program: env!("CARGO_BIN_EXE_foreign_gem_hop"),
    folder: env!("CARGO_MANIFEST_DIR"),
    game: "gem_hop",
    demonstrator: "runner",
    key: "Right",
    recorded: 1000,
    held_out: "default:100000..100001",
    recorded_ticks: None,
};

playbot_shell::tests!(GAME);
playbot_shell::tests!(GAME: defects_need_levels, planted_defects_are_scored);
#[cfg(feature = "screen")]
playbot_shell::tests!(GAME: a_hidden_window_holds_no_key_and_plays_on);
