//! The verbs of the command line, as users call them.

use playbot_shell::GameProgram;

const GAME: GameProgram = GameProgram {
    program: env!("CARGO_BIN_EXE_foreign_breakout"),
    folder: env!("CARGO_MANIFEST_DIR"),
    game: "breakout",
    demonstrator: "follower",
    key: "Left",
};

playbot_shell::tests!(GAME);
