//! The verbs of the command line, as users call them.

use playbot_shell::{Desk, GameProgram, Shell};

const GAME: GameProgram = GameProgram {
    program: env!("CARGO_BIN_EXE_foreign_gem_hop"),
    folder: env!("CARGO_MANIFEST_DIR"),
    game: "gem_hop",
    demonstrator: "runner",
    key: "Right",
};

#[test]
fn recordings_replay() {
    GAME.recordings_replay();
}

#[test]
fn moments_are_drawn() {
    GAME.moments_are_drawn();
}

#[test]
fn a_killed_training_goes_on_bit_for_bit() {
    GAME.a_killed_training_goes_on_bit_for_bit();
}

#[test]
fn a_policy_file_plays_as_its_run() {
    GAME.a_policy_file_plays_as_its_run();
}

#[test]
fn the_doctor_finds_nothing() {
    GAME.the_doctor_finds_nothing();
}

#[test]
fn a_window_cannot_be_built_anew() {
    let (desk, shell) = (Desk::new(GAME.program), Shell::new(GAME.program));
    let output = desk.command(shell.folder(), &["play", GAME.game]).output().expect("the program starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("`Restart::Rebuild`") && said.contains("`Restart::Startup`"), "{said}");
}
