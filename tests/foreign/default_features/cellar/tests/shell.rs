//! Tests of the verbs through the command line.

use std::fs;

use playbot_shell::{GameProgram, Shell};

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

/// The first rooms of the project are Pantry, Stairs and Larder.
#[test]
fn rooms_are_named_as_in_their_editor() {
    let shell = Shell::new(GAME.program);
    let shown = shell.done(&["level", "cellar", "--level", "Larder"]);
    assert!(shown.starts_with("default:2 is `Larder` of "), "{shown}");
    shell.done(&["test", "cellar", "--levels", "Pantry", "--bot", "guide", "--out", "tested"]);
    let line = fs::read_to_string(shell.path("tested/results.json")).expect("results");
    assert!(line.contains("\"level\":\"default:0\"") && line.contains("\"name\":\"Pantry\""), "{line}");
}
