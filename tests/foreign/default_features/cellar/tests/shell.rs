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
    recorded_ticks: None,
};

playbot_shell::tests!(GAME);
playbot_shell::tests!(GAME: defects_need_levels, planted_defects_are_scored);

/// The first rooms of the project are Pantry, Stairs and Larder.
#[test]
fn rooms_are_named_as_in_their_editor() {
    let shell = Shell::new(GAME.program);
    let shown = shell.done(&["level", "cellar", "--level", "Larder"]);
    assert!(shown.starts_with("default:2 is `Larder` of "), "{shown}");
    shell.done(&["test", "cellar", "--levels", "Pantry", "--bot", "guide", "--out", "tested"]);
    let line = fs::read_to_string(shell.path("tested/results.json")).expect("results");
    assert!(line.contains("\"level\":\"default:0\"") && line.contains("\"name\":\"Pantry\""), "{line}");
    shell.done(&["test", "cellar", "--level", "Pantry,Stairs", "--bot", "guide", "--out", "both"]);
    let lines = fs::read_to_string(shell.path("both/results.json")).expect("results");
    assert!(lines.contains("\"name\":\"Pantry\"") && lines.contains("\"name\":\"Stairs\""), "{lines}");
}

#[test]
fn a_scripted_bot_beside_the_demonstrator_is_measured_recorded_and_tests() {
    let shell = Shell::new(GAME.program);
    let measured = |bot: &str| {
        let row = shell.answer(&["eval", "--bot", bot, "--levels", "default:0..1", "--json"]);
        (
            row["method"].as_str().map(str::to_owned),
            row["success"].as_f64(),
            row["length_mean"].as_f64().expect("a number"),
        )
    };
    let [(_, _, short), (method, success, long)] = ["guide", "tourist"].map(measured);
    assert_eq!((method.as_deref(), success), (Some("tourist"), Some(1.0)));
    // By the rules, it takes 60 steps in the Pantry and 38 on the Stairs, and the guide 14 and 38.
    assert!(long > 1.5 * short, "{long} ticks of the tourist, {short} of the guide");
    let record = ["record", "cellar", "--bot", "tourist", "--noise", "0.1", "--levels", "default:0..1"];
    shell.done(&[&record[..], &["--out", "tour.demo"]].concat());
    let summary = shell.answer(&["demo", "ls", "tour.demo", "--json"]);
    assert_eq!(summary["header"]["demonstrator"], "tourist", "{summary}");
    let verified = shell.answer(&["demo", "verify", "tour.demo", "--json"]);
    assert_eq!(verified["report"]["divergences"].as_array().map(Vec::len), Some(0), "{verified}");
    shell.done(&["test", "cellar", "--level", "Pantry", "--bot", "tourist,guide", "--out", "tested"]);
    let results = fs::read_to_string(shell.path("tested/results.json")).expect("results");
    assert!(results.contains("\"tourist\"") && results.contains("\"guide\""), "{results}");
    let printed = refused(&shell, &["eval", "--bot", "tourists", "--levels", "default:0"]);
    let words = "unknown bot `tourists` (did you mean `tourist`?); valid: guide, random, chaos, tourist";
    assert!(printed.contains(words), "{printed}");
}

/// Returns what a refused command prints.
fn refused(shell: &Shell, args: &[&str]) -> String {
    let output = shell.command(args).output().expect("the program starts");
    let printed = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{args:?}: {printed}");
    printed
}

#[test]
fn no_verb_goes_past_the_last_room() {
    let shell = Shell::new(GAME.program);
    let beyond = "of `default` does not exist: `cellar` has levels 0 to 239";
    for args in [
        &["level", "cellar", "--level", "240"][..],
        &["test", "cellar", "--levels", "default:238..242", "--bot", "guide", "--out", "none"],
        &["record", "cellar", "--levels", "240", "--out", "none.demo"],
        &["eval", "--bot", "guide", "--levels", "default:999"],
        &["levels", "cellar", "--levels", "0..240"],
        &["view", "cellar", "--level", "240"],
        &["trace", "cellar", "--level", "240", "--actions", "0"],
        &["explore", "cellar", "--level", "240"],
        &["doctor", "cellar", "--level", "240"],
        &["bugs", "make", "cellar", "--levels", "cellar=default:0..240", "--out", "none"],
    ] {
        let printed = refused(&shell, args);
        assert!(printed.contains(beyond), "{args:?}: {printed}");
    }
    let another = shell.done(&["doctor", "cellar", "--level", "239", "--ticks", "20"]);
    assert!(another.contains("`--level 0` another level"), "{another}");
}

#[test]
fn a_room_that_does_not_exist_is_refused_with_the_first_rooms_and_the_usage_of_the_verb() {
    let shell = Shell::new(GAME.program);
    let printed = refused(&shell, &["level", "cellar", "--level", "Sellar"]);
    assert!(printed.contains("no level `Sellar`: its levels are Pantry, Stairs, Larder and 237 more"), "{printed}");
    assert!(printed.contains(" level [OPTIONS]"), "{printed}");
}
