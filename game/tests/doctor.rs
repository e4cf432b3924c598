//! `playbot doctor` as its users call it.

use std::process::{Command, Output};

use serde_json::Value;

fn doctor(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_playbot")).arg("doctor").args(args).output().expect("the program starts")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn a_healthy_game_passes_and_its_report_is_for_people() {
    let output = doctor(&["maze2d", "--mode", "medium", "--ticks", "30"]);
    let text = said(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    for words in ["maze2d (version", "mode medium", "two arenas in one World", "ticks per second", "No findings"] {
        assert!(text.contains(words), "`{words}` is missing in:\n{text}");
    }
}

#[test]
fn the_report_is_one_line_of_json_for_programs() {
    let output = doctor(&["coinrun", "--ticks", "20", "--seed", "7", "--json"]);
    assert_eq!(output.status.code(), Some(0));
    let report: Value = serde_json::from_str(said(&output).trim_end()).expect("one line of JSON");
    assert_eq!((&report["game"], &report["mode"], &report["seed"]), (&"coinrun".into(), &"easy".into(), &7.into()));
    assert_eq!(report["comparisons"].as_array().map(Vec::len), Some(5));
    assert_eq!(report["safety"]["recording"]["safe"], true);
    assert_eq!(report["findings"].as_array().map(Vec::len), Some(0));
    assert!(report["ticks_per_second"].as_f64().is_some_and(|speed| speed > 0.0));
}

#[test]
fn wrong_names_and_numbers_are_usage_errors() {
    for (args, words) in [
        (&["coinrunn"][..], "did you mean `coinrun`?"),
        (&["coinrun", "--mode", "hrad"], "did you mean `hard`?"),
        (&["coinrun", "--ticks", "0"], "it must be at least 1"),
    ] {
        let output = doctor(args);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{errors}");
        assert!(errors.contains(words), "{errors}");
    }
}
