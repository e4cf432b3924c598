//! Levels that only another process can test: those of a level editor, which the program reads when it starts, and those of
//! code that was built anew.

use crate::{
    error::CliError,
    verbs::watch::{GLANCE, changes::Stamp, saves::LevelState},
};
use playbot_harness::split::LevelSplit;
use std::{
    collections::{BTreeMap, BTreeSet},
    env, fs,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
};

/// Most files that are looked at.
const MOST_FILES: usize = 20_000;

/// Options of the watch itself, which a process that tests once does not take: with a value, or without.
const OWN: [&str; 4] = ["--rebuild", "--code", "--assets", "--port"];

/// The last letters of a build that failed.
const MOST_LETTERS: usize = 2_000;

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
            Some(true) => None,
            Some(false) => {
                let start = text.char_indices().rev().nth(MOST_LETTERS).map_or(0, |(place, _)| place);
                Some(format!("`{command}` failed, and its levels are tested when it works:\n{}", text[start..].trim()))
            }
            None => Some(format!("`{command}` was stopped")),
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

/// Waits for the end of a process. Returns whether it succeeded; `None` if it was stopped.
fn end_of(child: &mut Child, stop: &dyn Fn() -> bool) -> Option<bool> {
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status.success()),
            Ok(None) if stop() => {
                // It is over either way.
                let _ = child.kill();
                let _ = child.wait();
                return None;
            }
            Ok(None) => thread::park_timeout(GLANCE),
            Err(_) => return Some(false),
        }
    }
}

/// The command that tests a range of levels once.
pub(super) struct Rebuilt {
    options: Vec<String>,
    folder: PathBuf,
}

impl Rebuilt {
    /// Takes the options that this program was called with.
    pub fn new(split: &LevelSplit, folder: &Path) -> Self {
        let mut options: Vec<String> = own_options(env::args().skip(1));
        if !options.iter().any(|word| is_option(word, "--levels") || is_option(word, "--level")) {
            options.extend(["--levels".to_owned(), split.to_string()]);
        }
        options.retain(|word| word != "--json");
        Self { options, folder: folder.to_owned() }
    }

    /// Tests all levels but those of a known layout in a new process, and hands over what is found of each.
    ///
    /// # Errors
    ///
    /// `each` failed. That the process fails is a line of its own for people.
    pub fn test(
        &self,
        known: &BTreeSet<String>,
        stop: &dyn Fn() -> bool,
        each: &mut dyn FnMut(LevelState) -> Result<(), CliError>,
    ) -> Result<(), CliError> {
        let known: Vec<&str> = known.iter().map(String::as_str).collect();
        let program = env::args_os().next().map(PathBuf::from).filter(|path| path.is_file());
        let program = program.or_else(|| env::current_exe().ok()).unwrap_or_default();
        let mut command = Command::new(&program);
        command.args(&self.options).args(["--once", "--json", "--known", &known.join(",")]);
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        let mut child = match command.spawn() {
            Ok(child) => child,
            Err(error) => {
                report!("{} does not start, and its levels are tested when it works: {error}", program.display());
                return Ok(());
            }
        };
        let Some(output) = child.stdout.take() else { return Ok(()) };
        for line in BufReader::new(output).lines() {
            let Ok(line) = line else { break };
            match serde_json::from_str::<LevelState>(&line) {
                Ok(state) => each(state)?,
                Err(_) => report!("{line}"),
            }
        }
        if end_of(&mut child, stop).is_none() {
            report!("the test was stopped; what it found is kept in {}", self.folder.display());
        }
        Ok(())
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
}
