//! Tests of detectors on the command line.

use std::fs;

use crate::program::{done, ended};

#[test]
fn detectors_are_listed_with_what_they_find_and_their_settings() {
    let temporary = tempfile::tempdir().expect("a folder");
    for call in [&["test", "--detectors"][..], &["test", "maze2d", "--detectors"]] {
        let (list, _) = done(temporary.path(), call);
        for words in ["unreachable-goal", "stuck", "ticks=300", "entity-leak", "tick-time"] {
            assert!(list.contains(words), "`{words}` is missing in: {list}");
        }
    }
    let (json, _) = done(temporary.path(), &["test", "coinrun", "--detectors", "--json"]);
    let values: Vec<serde_json::Value> =
        json.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect();
    let stuck = values.iter().find(|detector| detector["name"] == "stuck").expect("it is listed");
    assert_eq!((stuck["looks"].as_str(), stuck["settings"]["ticks"].as_f64()), (Some("default"), Some(300.0)));
}

#[test]
fn slow_ticks_have_a_file_of_their_own_and_fail_nothing() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let test = |rest: &[&str]| {
        let call = ["test", "coinrun", "--levels", "hard:0..1", "--bot", "search", "--out", "t", "--no-detect", "all"];
        done(folder, &[&call[..], rest].concat())
    };
    let slowest = ["--detect", "tick-time", "--detector", "tick-time.milliseconds=0.0000001"];
    let (_, messages) = test(&slowest);
    assert!(messages.contains("slow ticks in"), "{messages}");
    let slow = fs::read_to_string(folder.join("t/timing.jsonl")).expect("there are slow ticks");
    assert!(slow.lines().all(|line| line.contains("\"detector\":\"tick-time\"")), "{slow}");
    let results = || fs::read_to_string(folder.join("t/results.json")).expect("results");
    let with_clock = results();
    test(&["--force"]);
    assert!(!folder.join("t/timing.jsonl").exists(), "those of the earlier test are gone");
    assert_eq!(with_clock, results());
}

#[test]
fn a_test_names_the_detectors_that_have_not_looked_once() {
    let temporary = tempfile::tempdir().expect("a folder");
    let test = |rest: &[&str]| {
        let call = ["test", "coinrun", "--levels", "easy:0", "--bot", "search", "--out", "t", "--force"];
        let (_, messages) = done(temporary.path(), &[&call[..], rest].concat());
        let lines: Vec<&str> = messages.lines().filter(|line| line.contains("opt-in detector")).collect();
        assert_eq!(lines.len(), 1, "{messages}");
        lines[0].to_owned()
    };
    let line = test(&[]);
    for words in [" opt-in detectors are off: ", "dead-action, fading-action", "`--detect fading-action` adds one"] {
        assert!(line.contains(words), "`{words}` is missing in: {line}");
    }
    assert!(line.contains("determinism"), "{line}");
    let line = test(&["--detect", "determinism", "--no-detect", "stuck"]);
    assert!(!line.contains("determinism") && !line.contains("stuck"), "{line}");
}

#[test]
fn what_is_no_detector_is_reported_with_what_would_be_right() {
    let temporary = tempfile::tempdir().expect("a folder");
    for (option, value, words) in [
        ("--detect", "short-cut", "did you mean `shortcut`?"),
        ("--no-detect", "stuk", "did you mean `stuck`?"),
        ("--detector", "stuck.tick=4", "did you mean `ticks`?"),
        ("--detector", "shortcut.par=4", "--detect shortcut"),
    ] {
        let call = ["test", "coinrun", "--levels", "hard:0", "--out", "t", option, value];
        let (_, messages) = ended(temporary.path(), &call, 3);
        assert!(messages.contains(words), "{messages}");
    }
}

#[test]
fn a_test_with_other_detectors_does_not_go_on_with_this_one() {
    let temporary = tempfile::tempdir().expect("a folder");
    let call = ["test", "coinrun", "--levels", "hard:0..1", "--bot", "search", "--out", "t"];
    done(temporary.path(), &call);
    let other = [&call[..], &["--no-detect", "stuck", "--resume"]].concat();
    let (_, messages) = ended(temporary.path(), &other, 3);
    assert!(messages.contains("detectors"), "{messages}");
}

#[test]
fn pars_are_those_of_a_file_or_of_recordings() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let test = |par: &str, wanted: i32| {
        let call = ["test", "coinrun", "--levels", "easy:0", "--bot", "search", "--out", "t", "--force"];
        ended(folder, &[&call[..], &["--no-detect", "all", "--par", par]].concat(), wanted)
    };
    let results = || fs::read_to_string(folder.join("t/results.json")).expect("results");
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).expect("writable");
    write("slow.json", r#"{"easy:0": 100000}"#);
    let (_, messages) = test("slow.json", 1);
    assert!(results().contains("\"detector\":\"shortcut\""), "{}", results());
    assert!(messages.contains("see it: playbot replay t/findings/easy-0.shortcut.search-"), "{messages}");
    let regress = |more: &[&str], wanted: i32| ended(folder, &[&["test", "--regress", "t"][..], more].concat(), wanted);
    assert!(regress(&[], 1).0.contains("still-there"));
    assert!(regress(&["--detector", "shortcut.factor=0.4"], 1).0.contains("still-there"));
    assert!(regress(&["--detector", "shortcut.facto=0.4"], 3).1.contains("did you mean `factor`?"));
    assert!(regress(&["--no-detect", "shortcut"], 3).1.contains("--regress"));

    write("others.json", r#"{"easy:7": 5, "esay:0": 5}"#);
    let words = "pars for 0 of 1 level; 2 names are no level of this test: easy:7, esay:0 (did you mean easy:0?)";
    assert!(test("others.json", 3).1.contains(words));
    write("quick.json", r#"{"easy:0": 1, "easy:1": 5}"#);
    test("quick.json", 1);
    assert!(results().contains("\"detector\":\"too-long\"") && results().contains("\"pars "), "{}", results());
    done(folder, &["record", "coinrun", "--levels", "easy:0..0", "--noise", "0", "--out", "a.demo"]);
    test("a.demo", 0);
    write("bad.json", r#"{"easy:0": 0}"#);
    for (par, words) in [("bad.json", "the par of easy:0 is 0"), ("none.json", "cannot read none.json")] {
        assert!(test(par, 3).1.contains(words), "{par}");
    }
}
