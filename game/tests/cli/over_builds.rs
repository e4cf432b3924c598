//! Tests of `playbot test --history` and `playbot history`.

use std::fs;

use serde_json::Value;

use crate::program::{ended, json_lines};

#[test]
fn a_level_that_breaks_is_dated_to_its_build() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    for level in ["3", "4"] {
        let (text, _) = ended(folder, &["level", "coinrun", "--mode", "easy", "--level", level, "--json"], 0);
        fs::write(folder.join(format!("{level}.json")), text).expect("writable");
    }
    let test = |build: &str, wanted: i32| {
        let out = format!("runs/{build}");
        let test = ["test", "coinrun", "--levels", "files:*.json", "--bot", "search", "--out", &out];
        let (_, said) = ended(folder, &[&test[..], &["--history", "h.jsonl", "--build", build]].concat(), wanted);
        assert!(said.contains("h.jsonl has "), "{said}");
    };
    test("monday", 0);
    test("tuesday", 0);
    let mut level: Value =
        serde_json::from_str(&fs::read_to_string(folder.join("4.json")).expect("text")).expect("JSON");
    for row in level["rows"].as_array_mut().expect("rows") {
        let cells = row.as_str().expect("a row").to_owned();
        *row = format!("{}#{}", &cells[..5], &cells[6..]).into();
    }
    fs::write(folder.join("4.json"), level.to_string()).expect("writable");
    test("wednesday", 1);
    test("thursday", 1);

    let (words, said) = ended(folder, &["history", "h.jsonl", "--out", "h.html"], 1);
    assert!(words.contains("4.json") && words.contains("broken since wednesday (sound in tuesday)"), "{words}");
    assert!(!words.contains("3.json") && said.contains("2 levels over 4 builds: 1 broken, 0 flaky"), "{words}{said}");
    assert!(fs::read_to_string(folder.join("h.html")).expect("written").contains("broken since wednesday"));
    let rows = json_lines(&ended(folder, &["history", "h.jsonl", "--json"], 1).0);
    assert_eq!((&rows[0]["course"], &rows[0]["since"]), (&"broken".into(), &"wednesday".into()), "{rows:?}");
    assert_eq!((&rows[0]["findings"][0]["first"], &rows[0]["outcomes"][0]), (&"wednesday".into(), &"solved".into()));
    assert_eq!(rows[1]["course"], "sound", "{rows:?}");
    let (words, _) = ended(folder, &["report", "issues", "runs/thursday", "--form", "github"], 0);
    assert!(
        words.starts_with("::error file=4.json,line=1,title=unreachable-goal::") && words.lines().count() == 1,
        "{words}"
    );
    ended(folder, &["report", "issues", "runs/thursday", "--form", "sarif", "--out", "levels.sarif"], 0);
    let sarif: Value =
        serde_json::from_str(&fs::read_to_string(folder.join("levels.sarif")).expect("written")).expect("JSON");
    let place = &sarif["runs"][0]["results"][0]["locations"][0]["physicalLocation"]["artifactLocation"]["uri"];
    assert_eq!(place, "4.json");
    // Folders are builds, too.
    let (words, _) = ended(folder, &["history", "runs/monday", "runs/tuesday", "runs/thursday"], 1);
    assert!(words.contains("broken since runs/thursday (sound in runs/tuesday)"), "{words}");
    let (_, said) = ended(folder, &["history", "runs/monday", "runs/tuesday"], 0);
    assert!(said.contains("0 broken, 0 flaky"), "{said}");
}

#[test]
fn what_is_no_history_is_refused_before_the_test() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::write(folder.join("notes.txt"), "to do\n").expect("writable");
    let test =
        ["test", "coinrun", "--levels", "easy:0..1", "--bot", "search", "--out", "runs/a", "--history", "notes.txt"];
    let (_, said) = ended(folder, &test, 3);
    assert!(said.contains("notes.txt is no history"), "{said}");
    assert!(!folder.join("runs/a").exists());
    assert_eq!(fs::read_to_string(folder.join("notes.txt")).expect("kept"), "to do\n");
    let (_, said) = ended(folder, &["history", "nothing.jsonl"], 3);
    assert!(said.contains("nothing.jsonl"), "{said}");
}

/// Returns the script of a step of the action for GitHub.
#[cfg(unix)]
fn script_of(step: &str) -> String {
    let action = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../action.yml")).expect("it is there");
    let (_, rest) = action.split_once(&format!("- name: {step}\n")).expect("the step");
    let (_, script) = rest.split_once("      run: |\n").expect("its script");
    script.lines().take_while(|line| line.starts_with("        ")).map(|line| format!("{}\n", &line[8..])).collect()
}

#[cfg(unix)]
#[test]
fn the_action_annotates_files_and_ends_as_the_test_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::create_dir(folder.join("release")).expect("writable");
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_playbot"), folder.join("release/bots")).expect("writable");
    let (text, _) = ended(folder, &["level", "coinrun", "--mode", "easy", "--level", "3", "--json"], 0);
    let mut level: Value = serde_json::from_str(&text).expect("JSON");
    for wanted in [0, 1] {
        fs::write(folder.join("a.json"), level.to_string()).expect("writable");
        let mut step = std::process::Command::new("bash");
        step.args(["-e", "-o", "pipefail", "-c", &script_of("Test")]).current_dir(folder);
        step.envs([("PROGRAM", "bots"), ("GAME", "coinrun"), ("LEVELS", "files:*.json"), ("OUT", "runs/test")]);
        step.envs([("ARGUMENTS", "--bot search,random --episodes 2"), ("CARGO_TARGET_DIR", ".")]);
        step.envs([("GITHUB_STEP_SUMMARY", "summary"), ("GITHUB_OUTPUT", "output")]);
        let output = step.output().expect("a shell");
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(output.status.code(), Some(wanted), "{said}{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(said.contains("::error file=a.json,line=1,title=unreachable-goal::"), wanted == 1, "{said}");
        for file in ["summary", "output", "runs/test/levels.sarif", "runs/test/report.html"] {
            assert!(folder.join(file).is_file(), "{file}");
        }
        for row in level["rows"].as_array_mut().expect("rows") {
            let cells = row.as_str().expect("a row").to_owned();
            *row = format!("{}#{}", &cells[..9], &cells[10..]).into();
        }
    }
}

#[cfg(unix)]
#[test]
fn the_commit_since_which_a_finding_happens_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let git = |words: &[&str]| {
        let mut git = std::process::Command::new("git");
        git.args(["-c", "user.name=a", "-c", "user.email=a@b", "-c", "init.defaultBranch=main"]).args(words);
        let output = git.current_dir(folder).output().expect("git");
        assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    };
    let (text, _) = ended(folder, &["level", "coinrun", "--mode", "easy", "--level", "3", "--json"], 0);
    let mut level: Value = serde_json::from_str(&text).expect("JSON");
    git(&["init", "-q"]);
    fs::write(folder.join(".gitignore"), "runs\n").expect("writable");
    let mut commits = Vec::new();
    for number in 0..6 {
        if number == 4 {
            for row in level["rows"].as_array_mut().expect("rows") {
                let cells = row.as_str().expect("a row").to_owned();
                *row = format!("{}#{}", &cells[..9], &cells[10..]).into();
            }
        }
        fs::write(folder.join("a.json"), level.to_string()).expect("writable");
        fs::write(folder.join("notes"), number.to_string()).expect("writable");
        git(&["add", "-A"]);
        git(&["commit", "-q", "-m", &format!("commit {number}")]);
        commits.push(git(&["rev-parse", "HEAD"]));
    }
    ended(folder, &["test", "coinrun", "--levels", "files:*.json", "--bot", "search", "--out", "runs/a"], 1);
    let finding =
        fs::read_dir(folder.join("runs/a/findings")).expect("findings").next().expect("one").expect("readable");
    let finding = finding.path().display().to_string();
    let bisect = ["bisect", &finding, "--good", &commits[0], "--build", "test -f a.json"];
    let program = ["--program", env!("CARGO_BIN_EXE_playbot")];
    let (words, _) = ended(folder, &[&bisect[..], &program].concat(), 1);
    assert!(words.trim_end().ends_with("a: commit 4"), "{words}");
    assert_eq!(git(&["rev-parse", "HEAD"]), commits[5], "it is where it was");
    fs::write(folder.join("notes"), "changed").expect("writable");
    let (_, said) = ended(folder, &[&bisect[..], &program].concat(), 3);
    assert!(said.contains("files have changed since the last commit") && said.contains("notes"), "{said}");
}
