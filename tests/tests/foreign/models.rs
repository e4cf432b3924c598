//! Tests of language models that play a game which breaks.

use std::process::Command;

use playbot_shell::{ModelClient, Shell, ended};
use serde_json::{Value, json};

/// Returns the program, whose game panics when the paddle is at the right edge.
fn breaking(shell: &Shell, args: &[&str]) -> Command {
    let mut command = shell.command(args);
    command.env("BREAK", "edge");
    command
}

#[test]
fn a_panic_is_a_finding_and_the_session_goes_on_with_another_level() {
    let shell = Shell::new(env!("CARGO_BIN_EXE_broken"));
    let mut client =
        ModelClient::of(breaking(&shell, &["serve", "catch", "--mcp", "--levels", "default:0..9"]), "model");
    client.data("reset", json!({ "level": 2 }));
    client.data("act", json!({ "action": "nothing", "ticks": 3 }));
    let words = client.refused("act", json!({ "action": "ArrowRight", "ticks": 100 }));
    for part in
        ["the game has broken in tick", "the paddle falls off the table", "finding `panic` is stored in", "`reset`"]
    {
        assert!(words.contains(part), "`{part}` is missing in {words}");
    }
    assert!(client.refused("act", json!({ "action": "nothing" })).contains("has broken in the last episode"));
    assert!(client.refused("observe", json!({})).contains("has broken in the last episode"));
    let again = client.data("replay", json!({}));
    assert_eq!((&again["same"], &again["end"]), (&json!(true), &json!("broken")));

    assert_eq!(client.data("reset", json!({}))["level"], 3);
    let played = client.data("act", json!({ "action": "ArrowLeft", "ticks": 5 }));
    assert_eq!((&played["ticks"], &played["episode"]), (&json!(5), &json!(1)));
    let found = client.data("findings", json!({}))["findings"].take();
    let panics: Vec<&Value> =
        found.as_array().expect("a list").iter().filter(|found| found["detector"] == "panic").collect();
    assert_eq!((panics.len(), &panics[0]["level"], &panics[0]["episode"]), (1, &json!(2), &json!(0)));
    let file = panics[0]["file"].as_str().expect("a file").to_owned();
    let (code, said) = client.leave();
    assert_eq!(code, 0, "{said}");

    let (replayed, _) = ended(breaking(&shell, &["replay", &file, "--json"]), 0);
    assert!(replayed.contains("still-there") && replayed.contains("\"tester\":\"model\""), "{replayed}");
    let shorter = ["replay", &file, "--minimise", "--out", "short.finding"];
    ended(breaking(&shell, &shorter), 0);
    let (short, _) = ended(breaking(&shell, &["replay", "short.finding", "--json"]), 0);
    let ticks = |text: &str| serde_json::from_str::<Value>(text).expect("JSON")["ticks"].as_u64().expect("ticks");
    assert!(ticks(&short) < ticks(&replayed), "{short}{replayed}");
    let (regress, _) = ended(breaking(&shell, &["test", "--regress", "runs/mcp"]), 1);
    assert!(regress.contains("still-there"), "{regress}");
    // The tick that has broken is no part of the recording.
    let (verified, _) = ended(breaking(&shell, &["demo", "verify", "runs/mcp"]), 0);
    assert!(verified.contains("2 episodes, ") && verified.contains("all as recorded"), "{verified}");
}

#[test]
fn a_game_that_cannot_start_is_reported_before_anything_is_written() {
    let shell = Shell::new(env!("CARGO_BIN_EXE_broken"));
    let mut command = shell.command(&["serve", "catch", "--mcp"]);
    command.env("BREAK", "start");
    let (out, err) = ended(command, 2);
    assert!(out.is_empty() && err.contains("no saved game"), "{out}{err}");
    assert!(!shell.path("runs").exists());
}
