//! Tests of a game that prints to standard output.

use playbot_shell::{Shell, ended};
use serde_json::Value;

/// Returns the data and the messages of a verb of a game that prints.
fn printed(args: &[&str]) -> (String, String) {
    let shell = Shell::new(env!("CARGO_BIN_EXE_namesakes"));
    let mut command = shell.command(args);
    command.env("PRINTS", "1");
    ended(command, 0)
}

#[test]
fn what_a_game_prints_is_not_among_the_data_of_a_verb() {
    let (data, messages) = printed(&["doctor", "catch", "--ticks", "5", "--level", "0", "--json"]);
    let report: Value = serde_json::from_str(data.trim_end()).expect("one line of JSON");
    assert_eq!((data.lines().count(), &report["game"]), (1, &"catch".into()));
    assert!(messages.contains("the apples are ") && messages.contains("falling\n"), "{messages}");
}

#[test]
fn equal_lines_that_a_game_prints_are_written_once_and_counted() {
    let doctor = ["doctor", "catch", "--ticks", "5", "--level", "0"];
    let falling = |messages: &str| messages.lines().filter(|line| *line == "falling").count();
    let (_, messages) = printed(&doctor);
    assert_eq!(falling(&messages), 1, "{messages}");
    assert!(messages.contains(" times more: falling\n"), "{messages}");
    let (_, messages) = printed(&[&doctor[..], &["-v"]].concat());
    assert!(falling(&messages) > 5 && !messages.contains(" more: falling"), "{messages}");
}

#[test]
fn help_and_data_without_a_game_stay_where_they_are() {
    assert!(!printed(&["config", "presets"]).0.is_empty());
    assert!(printed(&["doctor", "--help"]).0.contains("--ticks"));
}
