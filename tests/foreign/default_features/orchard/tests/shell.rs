//! Tests of the verbs through the command line.

use playbot_shell::GameProgram;

const GAME: GameProgram = GameProgram {
    program: env!("CARGO_BIN_EXE_foreign_orchard"),
    folder: env!("CARGO_MANIFEST_DIR"),
    game: "orchard",
    demonstrator: "picker",
    key: "Right",
    recorded: 1000,
    held_out: "default:100000..100001",
    recorded_ticks: None,
};

playbot_shell::tests!(GAME);
playbot_shell::tests!(GAME: defects_need_levels, planted_defects_are_scored);
