//! A program that hands over two games of one name, or none, is told so, whatever it is asked for.

use playbot_shell::Shell;

/// Exit code and standard error of a program with so many games of one name.
fn said(games: &str, args: &[&str]) -> (Option<i32>, String) {
    let shell = Shell::new(env!("CARGO_BIN_EXE_namesakes"));
    let output = shell.command(args).env("GAMES", games).output().expect("the program starts");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn two_games_of_one_name_are_refused() {
    for args in [&["config", "presets"][..], &["doctor", "catch", "--ticks", "1"], &[]] {
        let (code, words) = said("2", args);
        assert_eq!(code, Some(3), "{args:?}: {words}");
        assert!(
            words.contains("error: two games are called `catch`: give each a name of its own"),
            "{args:?}: {words}"
        );
    }
}

#[test]
fn a_program_without_games_is_told_so() {
    let (code, words) = said("0", &["config", "presets"]);
    assert_eq!(code, Some(3), "{words}");
    assert!(words.contains("error: the program has no game: hand it at least one"), "{words}");
}

#[test]
fn one_game_of_a_name_is_served() {
    let (code, words) = said("1", &["doctor", "catch", "--ticks", "10"]);
    assert_eq!(code, Some(0), "{words}");
}
