//! Levels that only another process can test: those of a level editor, which the program reads when it starts, and those of
//! code that was built anew.

use crate::{
    error::CliError,
    output::program,
    verbs::watch::{GLANCE, changes::Stamp, saves::LevelState},
};
use playbot_learner::{disk, write_atomically};
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    env, fs,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::mpsc::{self, RecvTimeoutError},
    thread,
};

/// Most files that are looked at.
const MOST_FILES: usize = 20_000;

/// Options of the watch itself, which a process that tests once does not take: with a value, or without.
const OWN: [&str; 4] = ["--rebuild", "--code", "--assets", "--port"];

/// The last letters of a build or a test that failed.
const MOST_LETTERS: usize = 2_000;

/// Name of the file that names the layouts which a process need not test.
const KNOWN: &str = "known.json";

/// Looks for a Ctrl-C after a test has failed: the signal that ends a test may come to this process a little later.
const LOOKS_FOR_STOP: u32 = 5;

/// Files that levels depend on, and the command that builds the program.
pub(super) struct Sources {
    code: Vec<PathBuf>,
    assets: Vec<PathBuf>,
    rebuild: Option<String>,
}

/// The stamps of all files.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Seen {
    /// Code.
    pub code: BTreeMap<PathBuf, Stamp>,
    /// Everything else.
    pub assets: BTreeMap<PathBuf, Stamp>,
}

impl Sources {
    /// Names the files.
    ///
    /// # Errors
    ///
    /// One of them is not there, so that it could never change. Assets that are not named need not be there beside code.
    pub fn new(code: &[PathBuf], assets: &[PathBuf], rebuild: Option<String>) -> Result<Self, CliError> {
        let there = |named: &[PathBuf], usual: &str| {
            let all = if named.is_empty() { vec![PathBuf::from(usual)] } else { named.to_vec() };
            let missing = all.iter().find(|path| !path.exists()).cloned();
            (all, missing)
        };
        let ((code, no_code), (all_assets, no_assets)) = (there(code, "src"), there(assets, "assets"));
        let needs_code = rebuild.is_some();
        let is_named =
            (needs_code && no_code.is_some()) || (no_assets.is_some() && (!assets.is_empty() || !needs_code));
        let missing = if needs_code { no_code.or(no_assets) } else { no_assets };
        if let Some(missing) = missing.filter(|_| is_named) {
            return Err(CliError::Usage(format!(
                "nothing there could change: there is no {}; name what the levels depend on with --assets, or with --rebuild \
                 and --code, or level files with --levels files:PATTERN",
                missing.display()
            )));
        }
        Ok(Self { code: if needs_code { code } else { Vec::new() }, assets: all_assets, rebuild })
    }

    /// Returns the stamps of all files as they are now.
    pub fn look(&self) -> Seen {
        let all = |paths: &[PathBuf]| {
            let mut found = BTreeMap::new();
            paths.iter().for_each(|path| add(path, &mut found));
            found
        };
        Seen { code: all(&self.code), assets: all(&self.assets) }
    }

    /// Builds the program if its code was saved. Returns what went wrong.
    pub fn rebuild(&self, is_due: bool, stop: &dyn Fn() -> bool) -> Option<String> {
        let command = self.rebuild.as_ref().filter(|_| is_due)?;
        report!("building: {command}");
        let [name, option] = if cfg!(windows) { ["cmd", "/C"] } else { ["sh", "-c"] };
        let mut shell = Command::new(name);
        shell.args([option, command]).stdin(Stdio::null()).stdout(Stdio::piped());
        let started = shell.stderr(Stdio::piped()).spawn();
        let mut child = match started {
            Ok(child) => child,
            Err(error) => return Some(format!("`{command}` does not start: {error}")),
        };
        // What can be read of it is shown.
        fn all(pipe: Option<impl Read>) -> Vec<u8> {
            let mut text = Vec::new();
            let _ = pipe.map(|mut pipe| pipe.read_to_end(&mut text));
            text
        }
        let (output, errors) = (child.stdout.take(), child.stderr.take());
        let output = thread::spawn(move || all(output));
        let reader = thread::spawn(move || all(errors));
        let ended = end_of(&mut child, stop);
        let text = [output.join().unwrap_or_default(), reader.join().unwrap_or_default()].concat();
        let text = String::from_utf8_lossy(&text).into_owned();
        match ended {
            ProcessEnd::Code(Some(0)) => None,
            ProcessEnd::Code(_) => {
                let words = last_letters(&text).trim();
                Some(format!("`{command}` failed, and its levels are tested when it works:\n{words}"))
            }
            ProcessEnd::Stopped => Some(format!("`{command}` was stopped")),
        }
    }
}

/// Adds a file, or all files in a folder, but for hidden ones.
fn add(path: &Path, found: &mut BTreeMap<PathBuf, Stamp>) {
    if found.len() >= MOST_FILES {
        return;
    }
    if !path.is_dir() {
        found.extend(Stamp::of(path).map(|stamp| (path.to_owned(), stamp)));
        return;
    }
    let Ok(entries) = fs::read_dir(path) else { return };
    for entry in entries.flatten() {
        if !entry.file_name().to_string_lossy().starts_with('.') {
            add(&entry.path(), found);
        }
    }
}

/// The end of a process.
enum ProcessEnd {
    /// Its exit code; `None` if it has none, as after a signal.
    Code(Option<i32>),
    /// It was stopped.
    Stopped,
}

/// Waits for the end of a process.
fn end_of(child: &mut Child, stop: &dyn Fn() -> bool) -> ProcessEnd {
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return ProcessEnd::Code(status.code()),
            Ok(None) if stop() => {
                end(child);
                return ProcessEnd::Stopped;
            }
            Ok(None) => thread::park_timeout(GLANCE),
            Err(_) => return ProcessEnd::Code(None),
        }
    }
}

/// Ends a process, if it still runs.
fn end(child: &mut Child) {
    // It is over either way.
    let _ = child.kill();
    let _ = child.wait();
}

/// A process that ends with the value.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        end(&mut self.0);
    }
}

/// Returns the last letters of a text.
fn last_letters(text: &str) -> &str {
    let start = text.char_indices().rev().nth(MOST_LETTERS).map_or(0, |(place, _)| place);
    &text[start..]
}

/// Returns the lines of a pipe, as they come in.
fn lines_of(pipe: impl Read) -> impl Iterator<Item = String> {
    let lines = BufReader::new(pipe).split(b'\n').map_while(Result::ok);
    lines.map(|line| String::from_utf8_lossy(&line).trim_end().to_owned())
}

/// Prints what a process says, and returns the last of it.
fn last_words(pipe: impl Read) -> String {
    let mut words = String::new();
    for line in lines_of(pipe) {
        report!("{line}");
        words = format!("{}{line}\n", last_letters(&words));
    }
    words
}

/// A level that has the layout of its last test.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct UnchangedLevel {
    /// Its name.
    pub unchanged: String,
}

/// A line of a process that tests levels once for a watch.
#[derive(Debug, PartialEq)]
pub(super) enum LevelLine {
    /// A level was tested.
    Tested(Box<LevelState>),
    /// A level was not tested.
    Unchanged(UnchangedLevel),
}

impl LevelLine {
    /// Reads a line of JSON. `None` if it is another one.
    fn read(line: &str) -> Option<Self> {
        let tested = serde_json::from_str(line).map(|state| Self::Tested(Box::new(state)));
        tested.or_else(|_| serde_json::from_str(line).map(Self::Unchanged)).ok()
    }
}

/// The end of a test by a process.
#[derive(Debug, PartialEq)]
pub(super) enum TestEnd {
    /// All levels were tested, or are unchanged.
    Done,
    /// It failed: a sentence for people, with the last words of the process in the lines after it.
    Failed(String),
    /// It was stopped.
    Stopped,
}

/// Reads the layouts that a watch knows, by the names of their levels.
///
/// # Errors
///
/// The file cannot be read, or is none of a watch.
pub(super) fn read_layouts(path: &Path) -> Result<BTreeMap<String, String>, CliError> {
    let text = fs::read_to_string(path).map_err(|error| error.to_string());
    let layouts = text.and_then(|text| serde_json::from_str(&text).map_err(|error| error.to_string()));
    layouts.map_err(|error| CliError::Usage(format!("{} is no list of layouts: {error}", path.display())))
}

/// The command that tests levels once.
pub(super) struct Rebuilt {
    program: PathBuf,
    options: Vec<String>,
    folder: PathBuf,
}

impl Rebuilt {
    /// Takes the options that this program was called with. If these name no levels, the process tests those that its
    /// game has then.
    pub fn new(folder: &Path) -> Self {
        let mut options: Vec<String> = own_options(env::args().skip(1));
        options.retain(|word| word != "--json");
        Self { program: program::file().unwrap_or_default(), options, folder: folder.to_owned() }
    }

    /// Tests all levels but those with the layout of their last test in a new process, and hands over its lines.
    ///
    /// # Errors
    ///
    /// `each` failed, or the disk refuses.
    pub fn test(
        &self,
        known: &BTreeMap<String, String>,
        stop: &dyn Fn() -> bool,
        each: &mut dyn FnMut(LevelLine) -> Result<(), CliError>,
    ) -> Result<TestEnd, CliError> {
        // A file, since an argument has at most 128 KiB on Linux.
        let list = self.folder.join(KNOWN);
        let text = serde_json::to_string(known).unwrap_or_else(|_| "{}".to_owned());
        write_atomically(&list, text.as_bytes())
            .map_err(|error| CliError::Io(format!("cannot write {}: {error}", list.display())))?;
        let end = self.test_with(&list, stop, each);
        // It is of no more use, and the next one replaces it.
        let _ = disk::remove_file(&list);
        end
    }

    /// Tests all levels but those of a file.
    fn test_with(
        &self,
        known: &Path,
        stop: &dyn Fn() -> bool,
        each: &mut dyn FnMut(LevelLine) -> Result<(), CliError>,
    ) -> Result<TestEnd, CliError> {
        let program = self.program.display();
        let mut command = Command::new(&self.program);
        command.args(&self.options).args(["--once", "--json", "--known"]).arg(known);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut running = match command.spawn() {
            Ok(child) => Running(child),
            Err(error) => {
                return Ok(TestEnd::Failed(format!(
                    "{program} does not start, and its levels are tested at the next save: {error}"
                )));
            }
        };
        let errors = running.0.stderr.take().map(|pipe| thread::spawn(move || last_words(pipe)));
        let (sender, lines) = mpsc::channel();
        if let Some(pipe) = running.0.stdout.take() {
            thread::spawn(move || lines_of(pipe).try_for_each(|line| sender.send(line)));
        }
        loop {
            if stop() {
                return Ok(self.stopped());
            }
            match lines.recv_timeout(GLANCE) {
                Ok(line) => match LevelLine::read(&line) {
                    Some(found) => each(found)?,
                    None => report!("{line}"),
                },
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        let code = match end_of(&mut running.0, stop) {
            ProcessEnd::Stopped => return Ok(self.stopped()),
            ProcessEnd::Code(Some(0 | 1)) => return Ok(TestEnd::Done),
            ProcessEnd::Code(code) => code,
        };
        for _ in 0..LOOKS_FOR_STOP {
            if stop() {
                return Ok(self.stopped());
            }
            thread::park_timeout(GLANCE);
        }
        let words = errors.and_then(|errors| errors.join().ok()).unwrap_or_default();
        let code = code.map_or_else(|| "without an exit code".to_owned(), |code| format!("with exit code {code}"));
        Ok(TestEnd::Failed(format!(
            "{program} failed {code}, and its levels are tested at the next save:\n{}",
            words.trim()
        )))
    }

    fn stopped(&self) -> TestEnd {
        report!("the test was stopped; its verdicts are kept in {}", self.folder.display());
        TestEnd::Stopped
    }
}

fn is_option(word: &str, name: &str) -> bool {
    word == name || word.strip_prefix(name).is_some_and(|rest| rest.starts_with('='))
}

/// Returns the options without those of the watch itself, and their values.
fn own_options(words: impl Iterator<Item = String>) -> Vec<String> {
    let (mut kept, mut is_value) = (Vec::new(), false);
    for word in words {
        if std::mem::take(&mut is_value) {
            continue;
        }
        match OWN.into_iter().find(|name| is_option(&word, name)) {
            Some(name) => is_value = word == name,
            None => kept.push(word),
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_tests_once_gets_all_options_but_those_of_the_watch() {
        let words =
            "watch runner --levels plain:0..9 --rebuild make --port=0 --code src --bot random --assets=a --out o";
        let kept = own_options(words.split(' ').map(str::to_owned));
        assert_eq!(kept.join(" "), "watch runner --levels plain:0..9 --bot random --out o");
    }

    #[test]
    fn files_that_are_saved_made_or_deleted_are_seen() {
        let folder = tempfile::tempdir().expect("a folder");
        let (code, assets) = (folder.path().join("src"), folder.path().join("assets"));
        fs::create_dir_all(code.join("inner")).expect("writable");
        fs::create_dir(&assets).expect("writable");
        let file = code.join("inner/a.rs");
        fs::write(&file, "1").expect("writable");
        let sources = Sources::new(std::slice::from_ref(&code), std::slice::from_ref(&assets), Some("true".to_owned()));
        let sources = sources.expect("the code is there");
        let first = sources.look();
        assert_eq!((first.code.len(), first.assets.len()), (1, 0));
        fs::write(&file, "12").expect("writable");
        let second = sources.look();
        assert!(second.code != first.code && second.assets == first.assets);
        fs::write(assets.join(".hidden"), "").expect("writable");
        fs::write(assets.join("a.ldtk"), "").expect("writable");
        assert_eq!(sources.look().assets.len(), 1);
        fs::remove_dir_all(&code).expect("it is there");
        assert!(sources.look().code.is_empty());
        let code = Sources::new(&[folder.path().join("no-code")], &[], Some("true".to_owned())).err();
        assert!(code.is_some_and(|error| error.to_string().contains("no-code")), "code that is not there");
        let none = Sources::new(&[], &[folder.path().join("nothing")], None).err().map(|error| error.to_string());
        assert!(none.is_some_and(|words| words.contains("nothing there could change")));
    }

    #[test]
    #[cfg(unix)]
    fn a_build_that_fails_is_reported_with_its_last_words() {
        let sources = |command: &str| Sources { code: vec![], assets: vec![], rebuild: Some(command.to_owned()) };
        assert_eq!(sources("true").rebuild(true, &|| false), None);
        assert_eq!(sources("false").rebuild(false, &|| false), None);
        let words = sources("echo 'error: no such thing' >&2; exit 1").rebuild(true, &|| false).expect("it failed");
        assert!(words.contains("failed") && words.ends_with("error: no such thing"), "{words}");
        assert!(sources("exec sleep 60").rebuild(true, &|| true).is_some_and(|words| words.contains("was stopped")));
    }

    #[test]
    fn a_level_that_is_unchanged_is_told_from_one_that_was_tested() {
        let unchanged = UnchangedLevel { unchanged: "easy:3 Cave".to_owned() };
        let line = serde_json::to_string(&unchanged).expect("JSON");
        assert_eq!(line, r#"{"unchanged":"easy:3 Cave"}"#);
        assert_eq!(LevelLine::read(&line), Some(LevelLine::Unchanged(unchanged)));
        let state = LevelState::unreadable("a", "half".to_owned());
        let line = serde_json::to_string(&state).expect("JSON");
        assert_eq!(LevelLine::read(&line), Some(LevelLine::Tested(Box::new(state))));
        assert_eq!(LevelLine::read("a game may print here"), None);
    }

    /// Runs a shell's script instead of the program. Returns the end, and the lines.
    #[cfg(unix)]
    fn tested(script: &str, known: &BTreeMap<String, String>, stop: &dyn Fn() -> bool) -> (TestEnd, Vec<LevelLine>) {
        let folder = tempfile::tempdir().expect("a folder");
        let options = ["-c", script].map(str::to_owned).to_vec();
        let rebuilt = Rebuilt { program: "sh".into(), options, folder: folder.path().to_owned() };
        let mut lines = Vec::new();
        let end = rebuilt.test(known, stop, &mut |line| {
            lines.push(line);
            Ok(())
        });
        assert!(!folder.path().join(KNOWN).exists(), "it is not needed any more");
        (end.expect("writable"), lines)
    }

    #[test]
    #[cfg(unix)]
    fn a_process_gets_any_number_of_known_layouts_and_its_failure_is_reported_with_its_last_words() {
        // As one argument they would be larger than Linux allows.
        let known: BTreeMap<String, String> =
            (0..20_000_u64).map(|level| (format!("easy:{level}"), format!("{level:016x}"))).collect();
        // A shell counts the arguments from 0: --once, --json, --known, and the file.
        let script = r#"grep -o '"easy:777":"[0-9a-f]*"' "$3" >&2; printf '{"unchanged":"easy:777"}\n'"#;
        let (end, lines) = tested(&format!("{script}; exit 1"), &known, &|| false);
        assert_eq!(end, TestEnd::Done, "exit code 1 is that of findings");
        assert_eq!(lines, [LevelLine::Unchanged(UnchangedLevel { unchanged: "easy:777".to_owned() })]);
        let (end, lines) = tested(&format!("{script}; echo 'half a file' >&2; exit 101"), &known, &|| false);
        let TestEnd::Failed(words) = &end else { panic!("{end:?}") };
        assert!(words.contains("failed with exit code 101") && words.ends_with("half a file"), "{words}");
        assert!(words.contains(r#""easy:777":"0000000000000309""#) && lines.len() == 1, "{words}");
        let (end, _) = tested("kill -KILL $$", &known, &|| false);
        assert!(matches!(&end, TestEnd::Failed(words) if words.contains("without an exit code")), "{end:?}");
        assert_eq!(tested("exec sleep 60", &known, &|| true).0, TestEnd::Stopped);
    }
}
