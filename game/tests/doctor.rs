//! Tests of `playbot doctor` through its command line.

#[path = "shared/program.rs"]
mod program;

use std::path::Path;

use program::ended;
use serde_json::Value;

/// Returns the doctor's data and messages, with this exit code.
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
    let (text, _) = doctor(&["coinrun", "--ticks", "20", "--level", "7", "--json"], 0);
    let report: Value = serde_json::from_str(text.trim_end()).expect("one line of JSON");
    assert_eq!((&report["game"], &report["mode"], &report["level"]), (&"coinrun".into(), &"hard".into(), &7.into()));
    assert_eq!(report["seed"], 0);
    assert_eq!(report["comparisons"].as_array().map(Vec::len), Some(7));
    assert_eq!(report["safety"]["recording"]["safe"], true);
    assert_eq!(report["findings"].as_array().map(Vec::len), Some(0));
    assert!(report["ticks_per_second"].as_f64().is_some_and(|speed| speed > 0.0));
}

#[test]
fn two_levels_are_examined_unless_levels_are_named() {
    for (levels, first, further) in [
        (&[][..], 0, &[1][..]),
        (&["--level", "3"], 3, &[]),
        (&["--level", "3", "--level", "9", "--level", "3", "--level", "4"], 3, &[9, 4]),
    ] {
        let (text, words) = doctor(&[&["coinrun", "--ticks", "2", "--json"], levels].concat(), 0);
        let report: Value = serde_json::from_str(text.trim_end()).expect("one line of JSON");
        assert_eq!((&report["level"], &report["further_levels"]), (&first.into(), &further.into()), "{text}");
        let is_after = further.first().map(|level| format!("comparing: level {level} after level {first}\n"));
        assert!(is_after.is_none_or(|line| words.contains(&line)), "{words}");
    }
}

#[test]
fn a_seed_alone_is_the_level_too_for_one_more_version() {
    let (text, warning) = doctor(&["coinrun", "--ticks", "2", "--seed", "7", "--json"], 0);
    let report: Value = serde_json::from_str(text.trim_end()).expect("one line of JSON");
    assert_eq!((&report["level"], &report["seed"]), (&7.into(), &7.into()));
    assert!(warning.contains("for a level use --level 7"), "{warning}");
    let (text, words) = doctor(&["coinrun", "--ticks", "2", "--level", "7", "--seed", "8", "--json"], 0);
    let report: Value = serde_json::from_str(text.trim_end()).expect("one line of JSON");
    assert_eq!((&report["level"], &report["seed"]), (&7.into(), &8.into()));
    assert!(!words.contains("warning"), "{words}");
}

#[test]
fn an_unknown_type_to_ignore_is_reported() {
    let (text, _) = doctor(&["coinrun", "--ticks", "2", "--json"], 0);
    let report: Value = serde_json::from_str(text.trim_end()).expect("one line of JSON");
    let known = report["types"]["compared"][0].as_str().expect("a type");
    let (_, words) = doctor(&["coinrun", "--ticks", "2", "--ignore", known, "--ignore", "HighScor"], 0);
    assert_eq!(words.matches("warning: ").count(), 1, "{words}");
    assert!(words.contains("--ignore HighScor leaves nothing out"), "{words}");
}

#[test]
fn diagnostics_of_engines_can_be_compared_too() {
    let (text, _) = doctor(&["coinrun", "--ticks", "2", "--no-default-ignores", "--json"], 0);
    let report: Value = serde_json::from_str(text.trim_end()).expect("one line of JSON");
    assert_eq!(report["types"]["left_out"].as_array().map(Vec::len), Some(0));
    assert_eq!(report["notes"].as_array().map(Vec::len), Some(0));
}

#[test]
fn wrong_names_and_numbers_are_usage_errors() {
    for (args, words) in [
        (&["coinrunn"][..], "did you mean `coinrun`?"),
        (&["coinrun", "--mode", "hrad"], "did you mean `hard`?"),
        (&["coinrun", "--ticks", "0"], "it must be a whole number from 1 to 4294967295"),
        (&["coinrun", "--level", "4294967296"], "does not exist: `coinrun` has levels 0 to 4294967295"),
    ] {
        let (_, errors) = doctor(args, 3);
        assert!(errors.contains(words), "{errors}");
    }
}
