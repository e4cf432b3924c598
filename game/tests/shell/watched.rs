//! Tests of `playbot watch`: level files are tested when they are saved, and the page hears of it.

use std::{
    collections::BTreeSet,
    fs,
    io::{BufRead, BufReader, Lines, Write},
    net::TcpStream,
    path::Path,
    process::{Child, ChildStderr, Command, Stdio},
    thread,
    time::Duration,
};

use playbot_shell::json_lines;
use serde_json::Value;

use crate::program::{command, done, ended};

/// A watch, which ends with the value.
struct Watch {
    child: Child,
    errors: Lines<BufReader<ChildStderr>>,
    events: Lines<BufReader<TcpStream>>,
}

impl Drop for Watch {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Watch {
    /// Starts a watch, and listens as its page does.
    fn start(folder: &Path, args: &[&str]) -> Self {
        Self::of(command(folder, &[]), args)
    }

    /// Starts a watch of this program.
    fn of(mut program: Command, args: &[&str]) -> Self {
        program.args(["watch", "coinrun", "--port", "0"]).args(args);
        let mut child = program.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it starts");
        let mut errors = BufReader::new(child.stderr.take().expect("a pipe")).lines();
        let address = errors.by_ref().map_while(Result::ok).find_map(|line| {
            let (_, address) = line.split_once("http://")?;
            Some(address.to_owned())
        });
        let address = address.expect("the page has an address");
        let mut stream = TcpStream::connect(&address).expect("it listens");
        stream.set_read_timeout(Some(Duration::from_secs(60))).expect("a timeout");
        write!(stream, "GET /events HTTP/1.1\r\nHost: {address}\r\n\r\n").expect("it reads");
        Self { child, errors, events: BufReader::new(stream).lines() }
    }

    /// Waits for the next event whose final state of this level is as wanted, and returns the state. No final state in
    /// between may be another.
    fn next_final(&mut self, level: &str) -> Value {
        self.next(|save| finals(save).into_iter().find(|state| state["level"] == level).cloned())
    }

    /// Waits for the next event with a save in which `find` finds a value, and returns it.
    fn next<T>(&mut self, find: impl Fn(&Value) -> Option<T>) -> T {
        loop {
            let line = self.events.next().expect("the page goes on").expect("an event in time");
            let Some(data) = line.strip_prefix("data: ") else { continue };
            let data: Value = serde_json::from_str(data).expect("JSON");
            let saves = data.as_array().cloned().unwrap_or_else(|| vec![data]);
            if let Some(found) = saves.iter().rev().find_map(&find) {
                return found;
            }
        }
    }

    /// Waits for a line on standard error with these words.
    fn said(&mut self, words: &str) {
        let found = self.errors.by_ref().map_while(Result::ok).find(|line| line.contains(words));
        assert!(found.is_some(), "it does not say: {words}");
    }
}

/// Returns the final states of a save.
fn finals(save: &Value) -> Vec<&Value> {
    save["levels"].as_array().into_iter().flatten().filter(|state| state["verdict"]["is_final"] == true).collect()
}

/// Saves a file in one piece, so that a watch sees one save.
fn save_whole(folder: &Path, name: &str, text: &str) {
    let fresh = folder.join("fresh");
    fs::write(&fresh, text).expect("writable");
    fs::rename(fresh, folder.join(name)).expect("writable");
}

/// Writes a level of the game to a file, and returns its text.
fn drawn(folder: &Path, name: &str) -> String {
    let (text, _) = done(folder, &["level", "coinrun", "--mode", "easy", "--level", "3", "--json"]);
    fs::write(folder.join(name), &text).expect("writable");
    text
}

/// Returns the level with a wall from the ground to the sky between its start and its coin.
fn broken(text: &str) -> String {
    let mut level: Value = serde_json::from_str(text).expect("JSON");
    for row in level["rows"].as_array_mut().expect("rows") {
        let cells = row.as_str().expect("a row").to_owned();
        *row = format!("{}#{}", &cells[..9], &cells[10..]).into();
    }
    level.to_string()
}

#[test]
fn a_level_that_is_broken_by_hand_is_found_and_its_repair_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let text = drawn(folder, "a.json");
    drawn(folder, "b.json");
    let mut watch = Watch::start(folder, &["--levels", "files:*.json"]);
    let first = watch.next_final("a.json");
    assert_eq!(first["verdict"]["outcome"], "solved", "{first}");
    let ticks = first["verdict"]["ticks"].as_u64().expect("a solution");
    let picture = first["verdict"]["picture"].as_str().expect("a picture");
    assert!(picture.contains("<path class=\"way\" d=\"M"), "{picture}");
    watch.next_final("b.json");

    fs::write(folder.join("a.json"), broken(&text)).expect("writable");
    let second = watch.next_final("a.json");
    assert_ne!(second["verdict"]["outcome"], "solved", "{second}");
    assert_eq!(second["before"]["ticks"], ticks, "{second}");
    assert!(second["verdict"]["stored"].as_str().is_some_and(|words| words.contains("tick")), "{second}");
    assert!(second["verdict"]["reached"]["open"].as_u64() > Some(0), "{second}");
    assert!(second["verdict"]["picture"].as_str().is_some_and(|svg| svg.contains("class=\"missed\"")), "{second}");

    // An editor that writes in two pieces: half a level is none.
    let (half, rest) = text.split_at(text.len() / 2);
    fs::write(folder.join("a.json"), half).expect("writable");
    #[expect(clippy::disallowed_methods, reason = "an editor takes its time")]
    thread::sleep(Duration::from_millis(120));
    fs::write(folder.join("a.json"), format!("{half}{rest}")).expect("writable");
    let third = watch.next_final("a.json");
    assert_eq!(third["verdict"]["outcome"], "solved", "{third}");
    assert_eq!(third["verdict"]["solved_by"], "the stored solution", "{third}");

    fs::write(folder.join("a.json"), half).expect("writable");
    let fourth = watch.next_final("a.json");
    assert!(fourth["problem"].as_str().is_some_and(|words| words.contains("a.json")), "{fourth}");

    let sent = Command::new("kill").args(["-INT", &watch.child.id().to_string()]).status().expect("a shell's kill");
    assert!(sent.success());
    let words: Vec<String> = watch.errors.by_ref().map_while(Result::ok).collect();
    assert_eq!(watch.child.wait().expect("a child").code(), Some(130));
    assert!(words.iter().any(|line| line.starts_with("stopped; 4 saves kept in runs/watch")), "{words:?}");
    assert!(folder.join("runs/watch/saves.jsonl").is_file() && folder.join("runs/watch/solutions").is_dir());
}

#[test]
fn a_folder_that_is_deleted_is_waited_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::create_dir(folder.join("levels")).expect("writable");
    let text = drawn(folder, "levels/a.json");
    let mut watch = Watch::start(folder, &["--levels", "files:levels/*.json"]);
    watch.next_final("levels/a.json");
    fs::remove_dir_all(folder.join("levels")).expect("it is there");
    let gone = watch.errors.by_ref().map_while(Result::ok).find(|line| line.contains("waiting until"));
    assert!(gone.is_some_and(|line| line.contains("files:levels/*.json matches no file")));
    fs::create_dir(folder.join("levels")).expect("writable");
    fs::write(folder.join("levels/a.json"), broken(&text)).expect("writable");
    assert_ne!(watch.next_final("levels/a.json")["verdict"]["outcome"], "solved");
}

#[test]
fn a_folder_without_levels_is_watched_until_the_first_one_is_saved() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let text = drawn(folder, "elsewhere.json");
    let levels = ["--levels", "files:levels/*.json"];
    let mut watch = Watch::start(folder, &levels);
    let waiting = watch.errors.by_ref().map_while(Result::ok).find(|line| line.contains("matches no file"));
    assert!(waiting.is_some_and(|line| line.ends_with(": waiting for the first one")));
    fs::create_dir(folder.join("levels")).expect("writable");
    fs::write(folder.join("levels/a.json"), text).expect("writable");
    assert_eq!(watch.next_final("levels/a.json")["verdict"]["outcome"], "solved");
    drop(watch);
    fs::remove_dir_all(folder.join("levels")).expect("it is there");
    let once = [&["watch", "coinrun", "--once"], &levels[..]].concat();
    assert!(ended(folder, &once, 3).1.contains("files:levels/*.json matches no file"), "scripts do not wait");
}

#[test]
fn levels_are_tested_once_for_scripts() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let text = drawn(folder, "a.json");
    let once = ["watch", "coinrun", "--levels", "files:*.json", "--once", "--json"];
    let rows = json_lines(&ended(folder, &once, 0).0);
    assert_eq!((rows.len(), &rows[0]["verdict"]["outcome"]), (1, &Value::from("solved")), "{rows:?}");
    fs::write(folder.join("b.json"), broken(&text)).expect("writable");
    let rows = json_lines(&ended(folder, &once, 1).0);
    assert_eq!(rows.len(), 2, "{rows:?}");
    assert_eq!(rows[0]["before"]["outcome"], "solved", "{rows:?}");
    let range = ["watch", "coinrun", "--levels", "easy:3..4", "--once"];
    let (words, _) = ended(folder, &range, 0);
    assert!(words.lines().all(|line| line.starts_with("easy:") && line.contains(": solved in ")), "{words}");
    let (_, errors) = ended(folder, &["watch", "coinrun", "--levels", "easy:3..4", "--port", "0"], 3);
    assert!(errors.contains("there is no assets; name what the levels depend on"), "{errors}");
}

#[test]
fn two_levels_that_are_saved_at_once_are_both_tested() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let text = drawn(folder, "a.json");
    drawn(folder, "b.json");
    let mut watch = Watch::start(folder, &["--levels", "files:*.json"]);
    watch.next(|save| (finals(save).len() == 2).then_some(()));
    for file in ["a.json", "b.json"] {
        save_whole(folder, file, &broken(&text));
    }
    // The watch may have seen them in one look, or in two.
    let mut missing = BTreeSet::from(["a.json", "b.json"]);
    while !missing.is_empty() {
        let unsolved = watch.next(|save| {
            let states = finals(save).into_iter().filter(|state| state["verdict"]["outcome"] != "solved");
            let levels: Vec<String> = states.filter_map(|state| Some(state["level"].as_str()?.to_owned())).collect();
            (!levels.is_empty()).then_some(levels)
        });
        missing.retain(|level| !unsolved.iter().any(|found| found == level));
    }
}

#[test]
fn an_undo_while_a_level_is_tested_brings_its_verdict_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let text = drawn(folder, "a.json");
    // The explorer of a level without a path plays for so long that the undo comes before its end.
    let mut watch = Watch::start(folder, &["--levels", "files:*.json", "--steps", "50000000"]);
    assert_eq!(watch.next_final("a.json")["verdict"]["outcome"], "solved");
    save_whole(folder, "a.json", &broken(&text));
    watch.next(|save| {
        let verdict = &save["levels"][0]["verdict"];
        let is_begun = verdict["is_final"] == false && verdict["outcome"].is_string();
        (is_begun && verdict["outcome"] != "solved").then_some(())
    });
    save_whole(folder, "a.json", &text);
    watch.next(|save| finals(save).iter().any(|state| state["verdict"]["outcome"] == "solved").then_some(()));
}

/// Returns a program with levels of an editor: its new processes test the files in `levels` instead of those that were
/// named. They fail as long as there is a file `half`.
fn with_editor(folder: &Path) -> Command {
    let script = r#"#!/bin/bash
program=PROGRAM
case " $* " in *" --known "*) ;; *) exec -a "$0" "$program" "$@" ;; esac
if [ -e half ]; then echo "levels.ldtk: half of a file" >&2; exit 101; fi
exec -a "$0" "$program" "${@//easy:3..3/files:levels/*.json}"
"#;
    let file = folder.join("bots");
    fs::write(&file, script.replace("PROGRAM", &format!("'{}'", env!("CARGO_BIN_EXE_playbot")))).expect("writable");
    let made = Command::new("chmod").arg("+x").arg(&file).status().expect("a shell's chmod");
    assert!(made.success());
    let mut program = Command::new(file);
    program.current_dir(folder);
    program
}

#[test]
fn levels_of_an_editor_are_tested_by_new_processes_whose_failure_is_a_problem() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::create_dir(folder.join("levels")).expect("writable");
    let text = drawn(folder, "levels/a.json");
    drawn(folder, "levels/b.json");
    let (a, b) = ("levels/a.json", "levels/b.json");
    let mut watch = Watch::of(with_editor(folder), &["--levels", "easy:3..3", "--assets", "levels"]);
    watch.next(|save| {
        let is_solved = |state: &Value| state["verdict"]["outcome"] == "solved";
        (finals(save).into_iter().filter(|state| is_solved(state)).count() == 2).then_some(())
    });
    // Broken, and undone to what was tested before.
    save_whole(folder, a, &broken(&text));
    watch.next(|save| finals(save).iter().any(|state| state["verdict"]["outcome"] != "solved").then_some(()));
    save_whole(folder, a, &text);
    let levels = watch.next(|save| {
        let levels = save["levels"].as_array()?;
        levels.iter().any(|state| state["verdict"]["outcome"] == "solved").then(|| levels.clone())
    });
    assert!(levels.len() == 1 && levels[0]["level"] == a, "the other one is unchanged: {levels:?}");

    // A process that fails is no test.
    fs::write(folder.join("half"), "").expect("writable");
    save_whole(folder, a, &broken(&text));
    let problem = watch.next(|save| save["problem"].as_str().map(str::to_owned));
    assert!(problem.contains("failed with exit code 101"), "{problem}");
    assert!(problem.ends_with("levels.ldtk: half of a file"), "{problem}");
    fs::remove_file(folder.join("half")).expect("it is there");
    // Exactly as before the failure: no level is tested, and the problem is over.
    save_whole(folder, a, &text);
    watch.said("all levels are as they were before that save");
    watch.next(|save| save["problem"].is_null().then_some(()));

    // Deleted in the editor.
    fs::remove_file(folder.join(b)).expect("it is there");
    let gone = watch.next(|save| save["gone"].as_array().cloned());
    assert_eq!(gone, [b]);
}

#[test]
fn a_build_that_failed_stays_due() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    for made in ["src", "assets"] {
        fs::create_dir(folder.join(made)).expect("writable");
    }
    let levels = ["--levels", "easy:3..3", "--rebuild", "test ! -e src/wrong || { echo wrong code; false; }"];
    let mut watch = Watch::start(folder, &levels);
    watch.next(|save| finals(save).first().map(|_| ()));
    fs::write(folder.join("src/wrong"), "").expect("writable");
    let problem = |save: &Value| save["problem"].as_str().map(|words| (save["number"].clone(), words.to_owned()));
    let (first, words) = watch.next(problem);
    assert!(words.ends_with("wrong code"), "{words}");
    // Another file is saved: the code still does not build.
    fs::write(folder.join("assets/a"), "").expect("writable");
    let (second, words) = watch.next(|save| problem(save).filter(|(number, _)| *number != first));
    assert!(words.ends_with("wrong code") && second.as_u64() > first.as_u64(), "{words}");
    fs::remove_file(folder.join("src/wrong")).expect("it is there");
    let state = watch.next(|save| {
        let state = &save["levels"][0];
        (save["problem"].is_null() && state["verdict"]["is_final"] == true && save["number"].as_u64() > second.as_u64())
            .then(|| state.clone())
    });
    assert_eq!(state["verdict"]["outcome"], "solved", "all levels are tested after a build: {state}");
}
