//! Tests of `playbot review`: findings are decided on by letters from standard input.

use std::{fs, path::Path, process::Output};

use serde_json::{Value, json};

use crate::program::{code, done, ended, errors, json_lines, piped, said};

/// A level without a path to its goal, and the other with one.
const LEVELS: [[&str; 4]; 2] =
    [["#######", "#SOO#G#", "#O#O###", "#######"], ["#######", "#SOOOG#", "#O#O###", "#######"]];

/// Tests two levels, of which one is proved unsolvable, and keeps a failed episode of the other.
fn tested(folder: &Path) -> String {
    for (rows, name) in LEVELS.iter().zip(["sealed.json", "open.json"]) {
        let level = json!({ "rows": rows, "rules": "sparse+end-at-goal+limit=3" });
        fs::write(folder.join(name), level.to_string()).expect("writable");
    }
    test(folder, &[], 1)
}

fn test(folder: &Path, more: &[&str], wanted: i32) -> String {
    let plan = ["test", "maze2d", "--levels", "files:*.json", "--bot", "random", "--keep-failures", "--out", "out"];
    ended(folder, &[&plan[..], more].concat(), wanted).1
}

/// Answers a review with these lines.
fn review(folder: &Path, more: &[&str], answers: &str) -> Output {
    piped(folder, &[&["review", "out"], more].concat(), answers)
}

fn decisions(folder: &Path, more: &[&str], wanted: i32) -> Vec<(String, Value)> {
    let (text, _) = ended(folder, &[&["review", "out", "--json"], more].concat(), wanted);
    let name = |line: &Value| line["finding"].as_str().expect("a file").to_owned();
    json_lines(&text).iter().map(|line| (name(line), line["decision"].clone())).collect()
}

#[test]
fn findings_are_kept_and_pinned_and_a_further_review_shows_the_rest() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    assert!(tested(folder).contains("decide on them one by one: playbot review out"));
    let all = decisions(folder, &[], 1);
    let [(failed, Value::Null), (sealed, Value::Null)] = all.as_slice() else { panic!("{all:?}") };
    assert!(failed.starts_with("open-json.not-solved.") && sealed.starts_with("sealed-json.unreachable-goal"));

    // The first one is left for later, the second one is pinned.
    let output = review(folder, &[], "?\ni\np\nnew level is drawn\n2099-01-31\n");
    let (shown, words) = (said(&output), errors(&output));
    assert_eq!(code(&output), 1, "one is left: {words}");
    assert!(shown.contains("finding 1 of 2: open-json.not-solved."), "{shown}");
    assert!(shown.contains("it happens again at tick 2, with the same state"), "{shown}");
    let rows: Vec<&str> = shown.lines().skip_while(|line| !line.starts_with('#')).collect();
    let signs = rows.iter().position(|row| row.ends_with("X the finding")).expect("an explanation of the signs");
    assert_eq!(signs, LEVELS[1][0].len(), "the plan of the maze has a row for each column of the file: {shown}");
    assert_eq!(rows[..signs].concat().matches('X').count(), 1, "{shown}");
    assert!(
        words.contains("i  ignore it for now") && words.contains("2 findings: 0 kept, 1 pinned, 1 left"),
        "{words}"
    );
    let pins = fs::read_to_string(folder.join("out/pins.ron")).expect("written");
    assert!(pins.contains(sealed.as_str()) && pins.contains("new level is drawn"), "{pins}");

    // Only the first one is shown now. The end of the input loses nothing.
    let output = review(folder, &["--regressions", "kept"], "k\n");
    assert_eq!(code(&output), 0, "{}", errors(&output));
    assert!(said(&output).contains("finding 1 of 1: open-json.not-solved."), "{}", said(&output));
    let kept = decisions(folder, &["--regressions", "kept"], 0);
    assert_eq!(kept, [(failed.clone(), json!("kept")), (sealed.clone(), json!("pinned"))]);
    let regress = ended(folder, &["test", "--regress", "kept", "--json"], 1).0;
    assert_eq!(json_lines(&regress)[0]["status"], "still-there", "{regress}");
    let (_, words) = done(folder, &["review", "out", "--regressions", "kept"]);
    assert!(words.contains("2 findings: 1 kept, 1 pinned, 0 left; --all shows them again"), "{words}");
    let output = review(folder, &["--regressions", "kept", "--all"], "s\n");
    assert!(
        said(&output).contains("finding 1 of 2: ") && said(&output).contains("it is kept as kept/"),
        "{}",
        said(&output)
    );
}

#[test]
fn a_test_does_not_count_levels_whose_findings_are_pinned() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    tested(folder);
    review(folder, &[], "i\np\nnew level is drawn\n2099-01-31\n");
    let words = test(folder, &["--force"], 1);
    assert!(words.contains("1 pinned finding; levels with nothing else wrong, which do not count: 1"), "{words}");
    for file in ["summary.md", "report.html"] {
        let page = fs::read_to_string(folder.join("out").join(file)).expect("written");
        assert!(page.contains("pinned until 2099-01-31: new level is drawn"), "{file}: {page}");
    }
    let page = fs::read_to_string(folder.join("out/report.html")).expect("written");
    assert!(page.contains("A failed episode of random is kept: "), "{page}");
    assert!(page.contains("playbot replay findings/open-json.not-solved."), "{page}");
    review(folder, &[], "p\nthe limit is short\n\n");
    let words = test(folder, &["--force"], 0);
    assert!(words.contains("2 pinned findings; levels with nothing else wrong, which do not count: 2"), "{words}");
    // A pin that has expired counts again, and one without a finding is reported.
    let pins = fs::read_to_string(folder.join("out/pins.ron")).expect("written");
    let older = pins.replace("2099-01-31", "2001-01-31");
    fs::write(
        folder.join("out/pins.ron"),
        older.replacen('[', "[(finding: \"x\", reason: \"y\", until: \"2099-01-31\"),", 1),
    )
    .expect("writable");
    let words = test(folder, &["--force"], 1);
    assert!(words.contains("has expired on 2001-01-31 (new level is drawn)"), "{words}");
    assert!(words.contains("there is no finding x, though it is pinned"), "{words}");
    fs::write(folder.join("out/pins.ron"), "[a]").expect("writable");
    assert!(test(folder, &["--force"], 3).contains("out/pins.ron, line 1"), "it is found before the test");
}

#[test]
fn pictures_are_drawn_in_the_form_that_is_named() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    tested(folder);
    for (form, begin) in
        [("kitty", "\u{1b}_Ga=T,f=100,q=2,"), ("iterm", "\u{1b}]1337;File=inline=1"), ("sixel", "\u{1b}Pq\"1;1;")]
    {
        let output = review(folder, &["--picture", form], "i\ni\n");
        let shown = said(&output);
        assert_eq!(shown.matches(begin).count(), 2, "{form}: {}", errors(&output));
        assert!(!shown.contains("S start"), "{form}: a picture is enough");
    }
    let output = review(folder, &["--picture", "none"], "i\ni\n");
    assert!(!said(&output).contains(['#', '\u{1b}']), "{}", said(&output));
}

#[test]
fn what_cannot_be_reviewed_is_said() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    fs::create_dir(folder.join("empty")).expect("writable");
    for (args, words) in [
        (&["review", "none"][..], "none is no folder: name the folder of a test"),
        (&["review", "empty"], "empty has neither results nor findings"),
        (&["review", "empty", "--json", "--all"], "cannot be used with"),
        (&["review", "empty", "--picture", "big"], "invalid value 'big'"),
    ] {
        let (_, reported) = ended(folder, args, 3);
        assert!(reported.contains(words), "{args:?}: {reported}");
    }
    tested(folder);
    // There are no answers: the input is no terminal, and is empty.
    let output = review(folder, &[], "");
    assert!(code(&output) == 3 && errors(&output).contains("standard input has no letters"), "{}", errors(&output));
    let output = review(folder, &["--regressions", "out/findings"], "k\n");
    assert!(code(&output) == 3 && errors(&output).contains("name another one"), "{}", errors(&output));
    // Damaged files are shown, with all the others.
    let (name, _) = decisions(folder, &[], 1).remove(0);
    fs::write(folder.join(format!("out/findings/{name}.finding")), "no finding").expect("writable");
    let output = review(folder, &[], "k\ni\ni\n");
    assert_eq!(code(&output), 1, "{}", errors(&output));
    assert!(errors(&output).contains("1 file of out cannot be read"), "{}", errors(&output));
    assert!(errors(&output).contains("it cannot be kept: out/findings/"), "{}", errors(&output));
    assert!(said(&output).contains("finding 2 of 2: sealed-json.unreachable-goal"), "{}", said(&output));
    fs::write(folder.join("out/results.json"), "{").expect("writable");
    assert_ne!(code(&review(folder, &[], "i\n")), 0);
}
