//! Tests of findings, replayed and tested again.

use std::{fs, path::Path};

use serde_json::{Value, json};

use crate::program::{code, done, ended, errors, json_lines, playbot};

/// Returns the files of findings of a test, by name.
fn findings(folder: &Path, out: &str) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder.join(out).join("findings")).expect("findings");
    let mut found: Vec<_> = entries
        .map(|entry| {
            let path = entry.expect("readable").path();
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            (name, fs::read(path).expect("readable"))
        })
        .collect();
    found.sort();
    found
}

fn line(text: &str) -> Value {
    json_lines(text).remove(0)
}

#[test]
fn a_failure_is_a_file_that_replays_in_another_process_and_gets_shorter() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let test = |out: &str, threads: &str| {
        let plan = ["test", "coinrun", "--levels", "hard:0..9", "--bot", "right-jump", "--keep-failures"];
        let output = playbot(folder, &[&plan[..], &["--out", out, "--threads", threads]].concat());
        assert_eq!(code(&output), 1, "{}", errors(&output));
        errors(&output)
    };
    let reported = test("one", "1");
    test("two", "2");
    let found = findings(folder, "one");
    assert!(!found.is_empty() && found == findings(folder, "two"), "threads change no byte");
    let kept = format!(" kept in one/findings; see it: playbot replay one/findings/{}", found[0].0);
    assert!(reported.contains(&kept), "{kept} is missing in {reported}");
    for (name, _) in &found {
        let file = format!("one/findings/{name}");
        let (again, _) = done(folder, &["replay", &file, "--json"]);
        assert_eq!(line(&again)["status"], "still-there", "{again}");
        assert_eq!(done(folder, &["replay", &file, "--json"]).0, again);
    }
    let lost = found.iter().find(|(name, _)| name.contains(".lost.")).unwrap_or(&found[0]);
    let file = format!("one/findings/{}", lost.0);
    done(folder, &["demo", "show", &file]);
    let pictures = ["--png", "new/still.png", "--apng", "new/moving.png", "--scale", "2"];
    let (out, reported) = done(folder, &[&["replay", &file][..], &pictures].concat());
    assert!(out.contains("played by right-jump") && out.contains("it happens again at tick"), "{out}");
    assert!(reported.contains("still.png shows tick"), "{reported}");
    let moving = fs::read(folder.join("new/moving.png")).expect("drawn");
    assert!(moving.starts_with(b"\x89PNG") && moving.windows(4).any(|part| part == b"acTL"), "it moves");

    let shorter = ["replay", &file, "--minimise", "--out", "short.finding", "--replays", "60", "--json"];
    let reported = line(&done(folder, &shorter).0);
    let (before, now) = (reported["original_ticks"].as_u64(), reported["minimised"]["ticks"].as_u64());
    assert!(now <= before && reported["minimised"]["replays"].as_u64() <= Some(60), "{reported}");
    let short = line(&done(folder, &["replay", "short.finding", "--json"]).0);
    assert_eq!((short["ticks"].as_u64(), short["original_ticks"].as_u64()), (now, before));
    assert!(ended(folder, &shorter, 3).1.contains("--force"));
}

#[test]
fn without_an_unsolved_level_no_failure_is_kept_and_the_program_says_so() {
    let temporary = tempfile::tempdir().expect("a folder");
    let test = ["test", "coinrun", "--levels", "easy:0..1", "--bot", "search", "--keep-failures", "--out", "t"];
    let (_, words) = done(temporary.path(), &test);
    assert!(words.contains("no failed episode is kept: each level was solved, or is proved unsolvable"), "{words}");
}

#[test]
fn stored_findings_stay_red_until_they_are_pinned_and_again_when_the_pin_expires() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let sealed = json!({ "rows": ["#######", "#SOO#G#", "#O#O###", "#######"], "rules": "sparse+end-at-goal" });
    let open = json!({ "rows": ["#######", "#SOO#G#", "#O#OOO#", "#######"], "rules": "sparse+end-at-goal" });
    let write = |level: &Value| fs::write(folder.join("sealed.json"), level.to_string()).expect("writable");
    write(&sealed);
    let test = ["test", "maze2d", "--levels", "files:*.json", "--bot", "random", "--out", "out"];
    ended(folder, &test, 1);
    let found = findings(folder, "out");
    let (name, _) = found.iter().find(|(name, _)| name.contains(".unreachable-goal-")).expect("it is proved");
    let results = fs::read_to_string(folder.join("out/results.json")).expect("written");
    assert!(results.contains(&format!("\"file\":\"findings/{name}\"")), "{results}");
    let file = format!("out/findings/{name}");
    let reported = done(folder, &["replay", &file]).0;
    assert!(reported.contains("maze2d sealed.json: unreachable-goal: "), "{reported}");
    assert!(
        done(folder, &["replay", &file, "--png", "a.png"]).1.contains("a.png shows the level: it was found before")
    );
    done(folder, &["level", "maze2d", "--file", "sealed.json", "--png", "b.png"]);
    let [seen, level] = ["a.png", "b.png"].map(|name| fs::read(folder.join(name)).expect("drawn"));
    assert!(seen == level, "both are the level");
    // Named as in reports, from the folder of the results: the level file is in a folder above.
    let (results, below) = (folder.join("out"), format!("findings/{name}"));
    let shorter = ["replay", &below, "--minimise", "--out", "short.finding"];
    assert!(done(&results, &shorter).0.contains("it happens again"), "{name}");
    let shown = done(&results, &["demo", "show", "short.finding"]).0;
    assert!(shown.contains("files:sealed.json"), "it names the level as the test did: {shown}");
    fs::remove_file(results.join("short.finding")).expect("it is there");
    assert!(ended(&results, &["test", "--regress", "."], 1).0.contains("still-there"));
    let summary = fs::read_to_string(results.join("summary.md")).expect("written");
    assert!(summary.contains("# from the folder of the results:"), "{summary}");

    let regress = |more: &[&str], wanted: i32| ended(folder, &[&["test", "--regress", "out"], more].concat(), wanted);
    let (table, words) = regress(&[], 1);
    assert!(table.contains("still-there") && words.contains("still there"), "{table}{words}");
    let pin = |name: &str| format!("(finding: \"{name}\", reason: \"new level is drawn\", until: \"2027-01-31\")");
    let pins: Vec<String> = found.iter().map(|(name, _)| pin(name)).chain([pin("none")]).collect();
    fs::write(folder.join("out/pins.ron"), format!("[{}]", pins.join(", "))).expect("writable");
    let (table, words) = regress(&["--today", "2027-01-31"], 0);
    assert!(table.contains("until 2027-01-31: new level is drawn"), "{table}");
    assert!(words.contains("there is no finding none, though it is pinned"), "{words}");
    assert!(regress(&["--today", "2027-02-01"], 1).1.contains("has expired on 2027-01-31"));
    assert!(regress(&["--today", "soon"], 3).1.contains("is not a date"));

    // Each edit is played: the wall that is left, and the one that is taken out.
    let walled = json!({ "rows": ["#######", "#SO##G#", "#O#O###", "#######"], "rules": "sparse+end-at-goal" });
    write(&walled);
    let (said, _) = done(folder, &["replay", &file]);
    let since = "; the level file sealed.json has changed since the test";
    assert!(said.contains("it happens again") && said.contains(since), "{said}");
    write(&open);
    let (said, _) = ended(folder, &["replay", &file], 1);
    assert!(said.contains(&format!("it does not happen any more{since}")), "{said}");
    assert_eq!(line(&ended(folder, &["replay", &file, "--json"], 1).0)["level_file_changed"], true);
    let (rows, words) = regress(&["--today", "2027-02-01", "--json"], 0);
    for row in json_lines(&rows) {
        let said = row["message"].as_str().expect("text");
        assert!(row["status"] == "gone" && said.ends_with(since), "{row}");
    }
    assert!(words.contains("0 unplayable"), "{words}");
    // A file that is no level is no repair.
    fs::write(folder.join("sealed.json"), "{}").expect("writable");
    let (_, words) = ended(folder, &["replay", &file], 3);
    assert!(words.contains("cannot be read any more") && words.contains("remove the finding"), "{words}");
    fs::remove_file(folder.join("sealed.json")).expect("it is there");
    let (_, words) = ended(folder, &["replay", &file], 3);
    assert!(
        words.contains("there is no level file sealed.json") && words.contains("bring the recorded file back"),
        "{words}"
    );
    let (_, words) = ended(folder, &["replay", "out"], 3);
    assert!(words.contains("out is a folder with ") && words.contains("such as out/findings/"), "{words}");
    assert!(words.contains("test --regress out"), "{words}");
    let (rows, _) = regress(&["--today", "2027-02-01", "--json"], 1);
    assert!(json_lines(&rows).iter().any(|row| row["status"] == "unplayable"), "{rows}");
}

#[test]
fn a_file_that_is_no_finding_is_reported() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    done(folder, &["record", "coinrun", "--levels", "easy:0..0", "--out", "a.demo"]);
    fs::create_dir(folder.join("empty")).expect("writable");
    for (args, words) in [
        (&["replay", "none.finding"][..], "none.finding: there is no such file"),
        (&["replay", "a.demo"], "a recording, but not a finding"),
        (&["replay", "a.demo", "--minimise"], "--out"),
        (&["replay", "a.demo", "--apng", "a.gif"], ".png"),
        (&["test", "--regress", "empty"], "empty has no findings"),
        (&["test", "--regress", "none"], "none is not a folder"),
        (&["replay", "empty"], "empty has no findings"),
        (&["test", "coinrun", "--regress", "empty"], "--regress"),
        (&["test", "--today", "2027-01-31"], "--regress"),
    ] {
        let (_, reported) = ended(folder, args, 3);
        assert!(reported.contains(words), "{args:?}: {reported}");
    }
}
