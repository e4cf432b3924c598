//! Tests of `playbot test --history` and `playbot history`.

use std::fs;
#[cfg(unix)]
use std::path::Path;

use serde_json::Value;

#[cfg(unix)]
use crate::program::command;
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
    let lines = fs::read_to_string(folder.join("h.jsonl")).expect("written");
    let builds = lines.lines().skip(1).map(|line| line.split_once(' ').expect("a checksum").1);
    let builds: Vec<Value> = builds.map(|build| serde_json::from_str(build).expect("JSON")).collect();
    let layout = |build: usize| &builds[build]["levels"]["4.json"]["layout"];
    assert!(layout(0).is_string() && layout(0) == layout(1) && layout(1) != layout(2), "{lines}");
    // A pinned finding is no error.
    let found = fs::read_dir(folder.join("runs/thursday/findings")).expect("findings").next().expect("one");
    let name = found.expect("readable").path().file_stem().expect("a name").to_string_lossy().into_owned();
    let pin = format!("[(finding: \"{name}\", reason: \"drawn anew\", until: \"2099-01-31\")]");
    fs::write(folder.join("runs/thursday/pins.ron"), pin).expect("writable");
    let (words, _) = ended(folder, &["report", "issues", "runs/thursday", "--form", "github"], 0);
    let notice = "::notice file=4.json,line=1,title=unreachable-goal::pinned until 2099-01-31: drawn anew; ";
    assert!(words.starts_with(notice) && words.lines().count() == 1, "{words}");
    // Folders are builds, too.
    let (words, _) = ended(folder, &["history", "runs/monday", "runs/tuesday", "runs/thursday"], 1);
    assert!(words.contains("broken since runs/thursday (sound in runs/tuesday)"), "{words}");
    let (words, said) = ended(folder, &["history", "runs/monday", "runs/tuesday"], 0);
    assert!(said.contains("0 broken, 0 flaky") && !said.contains("testers"), "{said}");
    assert_eq!(words.trim_end(), "every level was sound in every build");
}

#[test]
fn builds_of_other_testers_are_named_and_those_of_another_game_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let test = |game: &str, levels: &str, bot: &str, out: &str, wanted: i32| {
        let test = ["test", game, "--levels", levels, "--bot", bot, "--out", out, "--history", "h.jsonl"];
        ended(folder, &test, wanted)
    };
    test("coinrun", "easy:0..3", "search", "runs/search", 0);
    // It fails on two of them.
    test("coinrun", "easy:0..3", "right-jump", "runs/jump", 1);
    for builds in [&["runs/search", "runs/jump"][..], &["h.jsonl"]] {
        let (words, said) = ended(folder, &[&["history"], builds, &["--out", "h.html"]].concat(), 0);
        assert!(words.contains("easy:0") && words.contains("not comparable since "), "{words}");
        assert!(words.contains("no longer tested by search, newly tested by right-jump"), "{words}");
        assert!(said.contains("4 levels over 2 builds: 0 broken, 0 flaky, 2 not comparable"), "{said}");
        assert!(said.contains("the testers changed in "), "{said}");
        let page = fs::read_to_string(folder.join("h.html")).expect("written");
        assert!(page.contains("not comparable since ") && page.contains("2 levels always sound</summary>"), "{page}");
    }
    // The testers of both builds failed on it before.
    test("coinrun", "easy:0..3", "search,right-jump", "runs/both", 0);
    let (words, _) = ended(folder, &["history", "runs/both", "runs/jump"], 0);
    assert!(
        words.contains("not comparable since runs/jump (sound in runs/both): no longer tested by search"),
        "{words}"
    );

    let (_, said) = test("maze2d", "umaze:0..0", "waypoints", "runs/other", 3);
    assert!(said.contains("h.jsonl is the history of `coinrun`, not of `maze2d`"), "{said}");
    ended(folder, &["test", "maze2d", "--levels", "umaze:0..0", "--bot", "waypoints", "--out", "runs/maze"], 0);
    let (_, said) = ended(folder, &["history", "runs/search", "runs/maze"], 3);
    assert!(said.contains("runs/search has results of `coinrun`, and runs/maze of `maze2d`"), "{said}");
    fs::copy(folder.join("h.jsonl"), folder.join("other.jsonl")).expect("readable");
    let (_, said) = ended(folder, &["history", "h.jsonl", "other.jsonl"], 3);
    assert!(said.contains("h.jsonl is a file: name the file of a history alone, or folders of results"), "{said}");
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
    fs::create_dir(folder.join("a folder")).expect("writable");
    let test = [&test[..8], &["--history", "a folder"]].concat();
    let (_, said) = ended(folder, &test, 3);
    assert!(said.contains("a folder is a folder: name a file") && !folder.join("runs/a").exists(), "{said}");
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
        wall(&mut level);
    }
}

/// Calls git in a folder, and returns its output.
#[cfg(unix)]
fn git(folder: &Path, words: &[&str]) -> String {
    let mut git = std::process::Command::new("git");
    git.args(["-c", "user.name=a", "-c", "user.email=a@b", "-c", "init.defaultBranch=main"]).args(words);
    let output = git.current_dir(folder).output().expect("git");
    assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).trim().to_owned()
}

/// Commits all files, and returns the commit.
#[cfg(unix)]
fn committed(folder: &Path, words: &str) -> String {
    git(folder, &["add", "-A"]);
    git(folder, &["commit", "-q", "-m", words]);
    git(folder, &["rev-parse", "HEAD"])
}

/// Tests a level that cannot be solved, and returns the file of the finding.
#[cfg(unix)]
fn found(folder: &Path) -> String {
    ended(folder, &["test", "coinrun", "--levels", "files:*.json", "--bot", "search", "--out", "runs/a"], 1);
    let finding =
        fs::read_dir(folder.join("runs/a/findings")).expect("findings").next().expect("one").expect("readable");
    finding.path().display().to_string()
}

/// Puts a wall into a level that no bot passes.
#[cfg(unix)]
fn wall(level: &mut Value) {
    for row in level["rows"].as_array_mut().expect("rows") {
        let cells = row.as_str().expect("a row").to_owned();
        *row = format!("{}#{}", &cells[..9], &cells[10..]).into();
    }
}

#[cfg(unix)]
#[test]
fn the_commit_since_which_a_finding_happens_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let (text, _) = ended(folder, &["level", "coinrun", "--mode", "easy", "--level", "3", "--json"], 0);
    let mut level: Value = serde_json::from_str(&text).expect("JSON");
    git(folder, &["init", "-q"]);
    fs::write(folder.join(".gitignore"), "runs\n").expect("writable");
    let mut commits = Vec::new();
    for number in 0..6 {
        if number == 4 {
            wall(&mut level);
        }
        fs::write(folder.join("a.json"), level.to_string()).expect("writable");
        fs::write(folder.join("notes"), number.to_string()).expect("writable");
        commits.push(committed(folder, &format!("commit {number}")));
    }
    let finding = found(folder);
    let bisect = ["bisect", &finding, "--good", &commits[0], "--build", "test -f a.json"];
    let program = ["--program", env!("CARGO_BIN_EXE_playbot")];
    let (words, _) = ended(folder, &[&bisect[..], &program].concat(), 1);
    assert!(words.trim_end().ends_with("a: commit 4"), "{words}");
    assert_eq!(git(folder, &["rev-parse", "HEAD"]), commits[5], "it is where it was");
    fs::write(folder.join("notes"), "changed").expect("writable");
    let (_, said) = ended(folder, &[&bisect[..], &program].concat(), 3);
    assert!(said.contains("files have changed since the last commit") && said.contains("notes"), "{said}");
}

/// The temporary folders of bisections that are there.
#[cfg(unix)]
fn left_over(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.filter(|name| name.starts_with("playbot-bisect-")).collect()
}

#[cfg(unix)]
#[test]
fn a_game_in_a_sub_folder_is_bisected_and_commits_that_cannot_be_tried_are_left() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let (text, _) = ended(folder, &["level", "coinrun", "--mode", "easy", "--level", "3", "--json"], 0);
    let mut level: Value = serde_json::from_str(&text).expect("JSON");
    wall(&mut level);
    fs::write(folder.join("a.json"), level.to_string()).expect("writable");
    let finding = found(folder);
    // A program that says of each commit what `replay --json` would say, with the same exit codes.
    let fake = folder.join("runs/fake");
    let script = r#"#!/bin/sh
status=$(cat status)
printf '{"finding":"x","status":"%s","ticks":3}\n' "$status"
test "$status" = still-there
"#;
    fs::write(&fake, script).expect("writable");
    fs::set_permissions(&fake, fs::Permissions::from_mode(0o755)).expect("writable");
    git(folder, &["init", "-q"]);
    fs::write(folder.join(".gitignore"), "runs\nfolders\n").expect("writable");
    let game = folder.join("game");
    let mut commits = Vec::new();
    let statuses =
        [Some("gone"), Some("gone"), None, Some("gone"), Some("changed"), Some("changed"), Some("still-there")];
    for (number, status) in statuses.into_iter().enumerate() {
        let _ = fs::remove_dir_all(&game);
        if let Some(status) = status {
            fs::create_dir(&game).expect("writable");
            fs::write(game.join("status"), status).expect("writable");
        }
        fs::write(folder.join("notes"), number.to_string()).expect("writable");
        commits.push(committed(folder, &format!("commit {number}")));
    }
    let folders = folder.join("folders");
    fs::create_dir(&folders).expect("writable");
    let bisect = |build: &str, bad: &str, wanted: i32| {
        let mut call = command(&game, &["bisect", &finding, "--good", &commits[0], "--bad", bad, "--build", build]);
        call.arg("--program").arg(&fake).env("TMPDIR", &folders);
        let (words, said) = playbot_shell::ended(call, wanted);
        assert_eq!(git(folder, &["rev-parse", "HEAD"]), commits[6], "it is where it was");
        assert_eq!(left_over(&folders), [""; 0], "{said}");
        (words, said)
    };
    let (words, _) = bisect("test -f status", "HEAD", 1);
    assert!(words.trim_end().ends_with("a: commit 4"), "it happens there in another tick: {words}");
    // The commits in question cannot be built.
    let (words, said) = bisect("! grep -q 3 ../notes && ! grep -q 4 ../notes", "HEAD", 1);
    assert!(said.contains("the first bad commit is one of these"), "{said}");
    let named: Vec<&str> = words.lines().filter_map(|line| line.split(": ").nth(1)).collect();
    for commit in ["commit 3", "commit 4", "commit 5"] {
        assert!(named.contains(&commit), "{words}");
    }
    assert!(!named.contains(&"commit 0") && !named.contains(&"commit 6"), "{words}");
    let (_, said) = bisect("true", "no-commit", 3);
    assert!(said.contains("`git bisect start no-commit` failed"), "{said}");
    // What git says on standard output alone.
    let (_, said) = bisect("true", &commits[0], 3);
    assert!(said.contains("was both good and bad"), "{said}");
    // No commit can be built.
    let words = ["bisect", &finding, "--good", &commits[3], "--build", "echo line 1; echo no linker >&2; exit 3"];
    let mut call = command(&game, &words);
    call.arg("--program").arg(&fake);
    let (_, said) = playbot_shell::ended(call, 1);
    assert!(said.contains("the last commit that was left out: the build failed in "), "{said}");
    assert!(said.contains(":\nline 1\nno linker\n"), "{said}");
    let (_, said) = bisect("false", "HEAD", 1);
    assert!(said.contains("the last commit that was left out: "), "{said}");
    // A program that the shell finds by its name is not the one that is built.
    let mut call = std::process::Command::new("sh");
    let words = format!("exec playbot bisect '{finding}' --good {} --build true", commits[0]);
    call.args(["-c", &words]).current_dir(&game);
    let installed = folder.join("runs/bin");
    fs::create_dir(&installed).expect("writable");
    std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_playbot"), installed.join("playbot")).expect("writable");
    let path = std::env::var("PATH").unwrap_or_default();
    call.env("PATH", format!("{}:{path}", installed.display()));
    let (_, said) = playbot_shell::ended(call, 3);
    assert!(said.contains("name it, such as --program target/release/playbot"), "{said}");
}
