//! Tests of `playbot watch`: level files are tested when they are saved, and the page hears of it.

use std::{
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
        let watch = ["watch", "coinrun", "--port", "0"];
        let mut program = command(folder, &[&watch, args].concat());
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
        loop {
            let line = self.events.next().expect("the page goes on").expect("an event in time");
            let Some(data) = line.strip_prefix("data: ") else { continue };
            let data: Value = serde_json::from_str(data).expect("JSON");
            let saves = data.as_array().cloned().unwrap_or_else(|| vec![data]);
            let states = saves.iter().flat_map(|save| save["levels"].as_array().cloned().unwrap_or_default());
            let state = states.rev().find(|state| state["level"] == level && state["verdict"]["is_final"] == true);
            if let Some(state) = state {
                return state;
            }
        }
    }
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
