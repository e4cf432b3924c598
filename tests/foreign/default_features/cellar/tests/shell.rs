//! Tests of the verbs through the command line.

use playbot_shell::GameProgram;

const GAME: GameProgram = GameProgram {
    program: env!("CARGO_BIN_EXE_foreign_cellar"),
    folder: env!("CARGO_MANIFEST_DIR"),
    game: "cellar",
    demonstrator: "guide",
    key: "Right",
    recorded: 0,
    held_out: "default:118..119",
};

playbot_shell::tests!(GAME);
playbot_shell::tests!(GAME: what_verifies_is_learned_from, defects_need_levels);
