//! The verbs of the command line, as users call them.

use playbot_shell::{GameProgram, Shell, ended};

const GAME: GameProgram = GameProgram {
    program: env!("CARGO_BIN_EXE_foreign_breakout"),
    folder: env!("CARGO_MANIFEST_DIR"),
    game: "breakout",
    demonstrator: "follower",
    key: "Left",
};

playbot_shell::tests!(GAME);

/// The sound has a stand-in, so its file is not looked for.
#[test]
fn no_file_is_missed() {
    let shell = Shell::new(GAME.program);
    let (_, messages) = ended(shell.command(&["doctor", "breakout", "--ticks", "60"]), 0);
    assert!(!messages.contains("ERROR"), "{messages}");
}
