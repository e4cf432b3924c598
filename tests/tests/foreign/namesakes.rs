//! Tests of a program with two games of one name, or without games: every verb reports it.

use playbot_shell::{Shell, ended};

/// Returns the messages of a program with so many games of one name, which ends with this exit code.
fn reported(games: &str, args: &[&str], code: i32) -> String {
    let shell = Shell::new(env!("CARGO_BIN_EXE_namesakes"));
    let mut command = shell.command(args);
    command.env("GAMES", games);
    ended(command, code).1
}

#[test]
fn two_games_of_one_name_are_refused() {
    for args in [&["config", "presets"][..], &["doctor", "catch", "--ticks", "1"], &[]] {
        let words = reported("2", args, 3);
        assert!(
            words.contains("error: two games are called `catch`: give each a name of its own"),
            "{args:?}: {words}"
        );
    }
}

#[test]
fn a_program_without_games_is_refused() {
    let words = reported("0", &["config", "presets"], 3);
    assert!(words.contains("error: the program has no game: give it at least one"), "{words}");
}

#[test]
fn one_game_of_a_name_is_served() {
    reported("1", &["doctor", "catch", "--ticks", "10"], 0);
}
