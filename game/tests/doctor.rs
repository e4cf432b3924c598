//! `playbot doctor` as its users call it.

#[path = "shared/program.rs"]
mod program;

use std::path::Path;

use program::ended;
use serde_json::Value;

/// What the doctor says, and tells, with this exit code.
fn doctor(args: &[&str], code: i32) -> (String, String) {
    ended(Path::new("."), &[&["doctor"], args].concat(), code)
}

#[test]
fn a_healthy_game_passes_and_its_report_is_for_people() {
    let (text, _) = doctor(&["maze2d", "--mode", "medium", "--ticks", "30"], 0);
    for words in ["maze2d (version", "mode medium", "two arenas in one World", "ticks per second", "No findings"] {
        assert!(text.contains(words), "`{words}` is missing in:\n{text}");
    }
}

#[test]
fn the_report_is_one_line_of_json_for_programs() {
    let (text, _) = doctor(&["coinrun", "--ticks", "20", "--seed", "7", "--json"], 0);
    let report: Value = serde_json::from_str(text.trim_end()).expect("one line of JSON");
    assert_eq!((&report["game"], &report["mode"], &report["seed"]), (&"coinrun".into(), &"hard".into(), &7.into()));
    assert_eq!(report["comparisons"].as_array().map(Vec::len), Some(6));
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
        (&["coinrun", "--seed", "4294967296"], "does not exist: choose one up to 4294967295"),
    ] {
        let (_, errors) = doctor(args, 3);
        assert!(errors.contains(words), "{errors}");
    }
}
