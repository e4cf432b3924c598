//! The saves of a watch, and what was found after each: in memory, on disk, and in words.

use crate::{error::CliError, output::make_folder};
use bevy_playbot::{
    action::ActionValue,
    demo::file::{DemoReader, DemoWriter},
    state_hash::StateHash,
};
use playbot_harness::{game::Game, split::LevelSplit};
use playbot_learner::{
    Actions,
    disk::{self, DiskFile},
};
use playbot_report::counted;
use playbot_test::{explore::record_route, quick::QuickVerdict, verdict::LevelOutcome};
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeSet,
    fmt,
    fs::{OpenOptions, TryLockError},
    io::Write,
    path::{Path, PathBuf},
    time::{SystemTime, UNIX_EPOCH},
};

/// Name of the file that keeps the saves, one line of JSON each.
const SAVES: &str = "saves.jsonl";

/// Name of a file with lines that cannot be read.
const DAMAGED: &str = "saves.jsonl.damaged";

/// Name of the file that a watch holds.
const LOCK: &str = "watch.lock";

/// Most saves that are kept: the newest.
const MOST: usize = 200;

/// A save, and what was found after it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Save {
    /// Its number, from 1.
    pub number: u64,
    /// Its time, in milliseconds since 1970.
    pub at: u64,
    /// The levels that were tested.
    pub levels: Vec<LevelState>,
    /// The levels that are no longer there.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gone: Vec<String>,
    /// What kept all levels from being tested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<String>,
}

/// A level after a save.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct LevelState {
    /// Path of its file, or mode and number, with its name in a level editor.
    pub level: String,
    /// Seconds from the begin of its test.
    pub seconds: f64,
    /// The verdict.
    pub verdict: QuickVerdict,
    /// The verdict of the save before in which it was tested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<Before>,
    /// Why it could not be tested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub problem: Option<String>,
    /// Hash of its layout, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layout: Option<String>,
}

/// An earlier verdict, in numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Before {
    /// The outcome.
    pub outcome: Option<LevelOutcome>,
    /// Ticks of the shortest solution.
    pub ticks: Option<u32>,
    /// Episodes that were lost.
    pub lost: u64,
}

impl Save {
    /// Begins the save with this number now.
    pub fn new(number: u64) -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self { number, at: u64::try_from(now.as_millis()).unwrap_or(0), ..Self::default() }
    }

    /// Adds a level, or replaces what was known of it.
    pub fn put(&mut self, state: LevelState) {
        match self.levels.iter_mut().find(|known| known.level == state.level) {
            Some(known) => *known = state,
            None => self.levels.push(state),
        }
    }

    /// Returns whether nothing was found.
    pub fn is_empty(&self) -> bool {
        self.levels.is_empty() && self.gone.is_empty() && self.problem.is_none()
    }
}

impl LevelState {
    /// Describes a level that cannot be read.
    pub fn unreadable(level: &str, problem: String) -> Self {
        let verdict = QuickVerdict { is_final: true, ..QuickVerdict::default() };
        Self { level: level.to_owned(), seconds: 0.0, verdict, before: None, problem: Some(problem), layout: None }
    }
}

/// Warning about a level that every tester solves in its first tick.
const AT_START: &str = "it is solved in its first tick: the agent may start at its goal";

/// Returns the outcome as the page says it.
fn in_words(outcome: LevelOutcome) -> &'static str {
    match outcome {
        LevelOutcome::Solved => "solved",
        LevelOutcome::BotFailed => "not solved, nothing proved",
        LevelOutcome::ProvedUnsolvable => "unsolvable",
    }
}

impl fmt::Display for LevelState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { level, verdict, before, problem, seconds, .. } = self;
        if let Some(problem) = problem {
            return write!(f, "{level}: NOT TESTED: {problem}");
        }
        match (verdict.outcome, verdict.ticks) {
            (Some(LevelOutcome::Solved), count) => {
                write!(f, "{level}: solved")?;
                count.iter().try_for_each(|count| write!(f, " in {}", counted(u64::from(*count), "tick")))?;
                verdict.solved_by.iter().try_for_each(|tester| write!(f, " by {tester}"))?;
            }
            (Some(outcome), _) => write!(f, "{level}: {}", in_words(outcome).to_uppercase())?,
            (None, _) => write!(f, "{level}: not known")?,
        }
        if let Some(why) = &verdict.why {
            write!(f, ": {why}")?;
        }
        let was = before.as_ref().filter(|before| before.outcome != verdict.outcome || before.ticks != verdict.ticks);
        if let Some(was) = was {
            match (was.outcome, was.ticks) {
                (Some(LevelOutcome::Solved), Some(count)) => {
                    write!(f, " (before: in {})", counted(count.into(), "tick"))?
                }
                (Some(outcome), _) => write!(f, " (before: {})", in_words(outcome))?,
                (None, _) => {}
            }
        }
        if let Some(stored) = &verdict.stored {
            write!(f, "; the stored solution {stored}")?;
        }
        if let Some(places) = verdict.reached.filter(|places| places.open > 0) {
            let squares = counted(places.open, "square");
            write!(f, "; the explorer reaches {} of the {squares} that no wall cuts off", places.visited)?;
        }
        if verdict.lost > 0 {
            write!(f, "; {}", counted(verdict.lost, "death"))?;
        }
        if verdict.solved_at_start {
            write!(f, "; warning: {AT_START}")?;
        }
        // A proof that there is no path is a finding, too, and is printed above.
        for finding in verdict.findings.iter().filter(|finding| verdict.why.as_ref() != Some(&finding.message)) {
            write!(f, "; {}: {}", finding.detector, finding.message)?;
        }
        write!(f, " [{seconds:.2} s]")
    }
}

/// All saves, on disk and in memory.
pub(super) struct Saves {
    /// Held as long as the watch goes on: two of them in one folder would disturb each other.
    _lock: Option<DiskFile>,
    folder: PathBuf,
    kept: Vec<Save>,
    last_number: u64,
}

impl Saves {
    /// Opens the saves in a folder, or begins there. Returns what is wrong with the earlier ones, which are left out then.
    /// A part of another watch does not ask for the folder.
    ///
    /// # Errors
    ///
    /// The folder cannot be made, or another watch keeps its saves there.
    pub fn open(folder: &Path, is_part: bool) -> Result<(Self, Option<String>), CliError> {
        let failed =
            |error: std::io::Error| CliError::Io(format!("cannot keep saves in {}: {error}", folder.display()));
        make_folder(folder)?;
        let lock = if is_part { None } else { Some(lock(folder)?) };
        let file = folder.join(SAVES);
        let text = if file.is_file() { std::fs::read_to_string(&file).map_err(failed)? } else { String::new() };
        let (mut kept, mut damaged) = (Vec::new(), 0);
        for line in text.lines().filter(|line| !line.is_empty()) {
            match serde_json::from_str::<Save>(line) {
                Ok(save) => kept.push(save),
                Err(_) => damaged += 1,
            }
        }
        let message = (damaged > 0).then(|| {
            let lines = counted(damaged, "line");
            format!(
                "{lines} of {} can no longer be read, and those saves are left out; the file is kept as {DAMAGED}",
                file.display()
            )
        });
        let last_number = kept.iter().map(|save| save.number).max().unwrap_or(0);
        let kept = kept.split_off(kept.len().saturating_sub(MOST));
        let saves = Self { _lock: lock, folder: folder.to_owned(), kept, last_number };
        if damaged > 0 && !is_part {
            disk::rename(&file, &folder.join(DAMAGED)).map_err(failed)?;
        }
        // A file that only grows would be read for ever, and what is added must begin a line.
        let is_torn = !text.is_empty() && !text.ends_with('\n');
        if (damaged > 0 || is_torn || text.lines().count() > 2 * MOST) && !is_part {
            saves.write_all()?;
        }
        Ok((saves, message))
    }

    /// Returns the folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns the newest saves, in order.
    pub fn all(&self) -> &[Save] {
        &self.kept
    }

    /// Returns the number of the next save.
    pub fn next(&self) -> u64 {
        self.last_number + 1
    }

    /// Returns all levels that the page still shows.
    pub fn levels(&self) -> BTreeSet<String> {
        let mut levels = BTreeSet::new();
        for save in &self.kept {
            levels.retain(|level| !save.gone.contains(level));
            levels.extend(save.levels.iter().map(|state| state.level.clone()));
        }
        levels
    }

    /// Returns what was last known of a level.
    pub fn last(&self, level: &str) -> Option<Before> {
        let states = self.kept.iter().rev().flat_map(|save| save.levels.iter());
        let state = states.filter(|state| state.problem.is_none()).find(|state| state.level == level)?;
        let QuickVerdict { outcome, ticks, lost, .. } = &state.verdict;
        Some(Before { outcome: *outcome, ticks: *ticks, lost: *lost })
    }

    /// Keeps a save.
    ///
    /// # Errors
    ///
    /// The disk refuses.
    pub fn add(&mut self, save: Save) -> Result<(), CliError> {
        let line = line(&save)?;
        let path = self.folder.join(SAVES);
        let append = || {
            let mut file = DiskFile::open(&path, OpenOptions::new().create(true).append(true))?;
            file.write_all(line.as_bytes())
        };
        append().map_err(|error| CliError::Io(format!("cannot write {}: {error}", path.display())))?;
        self.last_number = self.last_number.max(save.number);
        self.kept.push(save);
        if self.kept.len() > MOST {
            self.kept.remove(0);
        }
        Ok(())
    }

    fn write_all(&self) -> Result<(), CliError> {
        let lines: Result<String, CliError> = self.kept.iter().map(line).collect();
        let path = self.folder.join(SAVES);
        playbot_learner::write_atomically(&path, lines?.as_bytes())
            .map_err(|error| CliError::Io(format!("cannot write {}: {error}", path.display())))
    }
}

/// Takes the folder for this watch.
fn lock(folder: &Path) -> Result<DiskFile, CliError> {
    let path = folder.join(LOCK);
    let failed = |error: std::io::Error| CliError::Io(format!("cannot use {}: {error}", path.display()));
    let file = DiskFile::open(&path, OpenOptions::new().create(true).append(true)).map_err(failed)?;
    match file.as_file().try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(CliError::Usage(format!(
            "{} is in use by another watch: stop it, or name another --out",
            folder.display()
        ))),
        Err(TryLockError::Error(error)) => Err(failed(error)),
    }
}

fn line(save: &Save) -> Result<String, CliError> {
    let text = serde_json::to_string(save);
    text.map(|text| format!("{text}\n"))
        .map_err(|error| CliError::Io(format!("a save cannot be written as JSON: {error}")))
}

// The actions that solved each level, as recordings that `playbot replay` and `playbot demo` can show.

/// Folder of the solutions, beside the saves.
const SOLUTIONS: &str = "solutions";

/// Solutions of the levels of a game.
pub(super) struct Solutions<'a> {
    game: &'a dyn Game,
    folder: PathBuf,
}

impl<'a> Solutions<'a> {
    /// Names the folder of the watch.
    pub fn new(game: &'a dyn Game, folder: &Path) -> Self {
        Self { game, folder: folder.join(SOLUTIONS) }
    }

    /// Returns the actions that last solved a level. `None` if there are none, or none that can be read.
    pub fn of(&self, level: &str) -> Option<Vec<ActionValue>> {
        let mut reader = DemoReader::open(self.file(level)).ok()?;
        if reader.header().game != self.game.name() {
            return None;
        }
        let episode = reader.next()?.ok()?;
        let actions: Vec<ActionValue> = episode.actions.iter().collect();
        // Another version of the game may have other actions.
        let mut fitting = Actions::empty(&self.game.actions());
        let fits = actions.iter().all(|action| fitting.push(action).is_ok());
        (fits && !actions.is_empty()).then_some(actions)
    }

    /// Keeps actions that solve a level.
    ///
    /// # Errors
    ///
    /// The game breaks its contract, or the disk refuses. An earlier solution stays.
    pub fn keep(&self, level: &str, split: &LevelSplit, solution: &[ActionValue]) -> Result<(), CliError> {
        let file = self.file(level);
        let failed = |error: std::io::Error| CliError::Io(format!("cannot write {}: {error}", file.display()));
        disk::create_dir_all(&self.folder).map_err(failed)?;
        let mut actions = Actions::empty(&self.game.actions());
        for action in solution {
            actions.push(action)?;
        }
        let mut header = self.game.demo_header(&split.mode);
        header.demonstrator = "watch".to_owned();
        let fresh = file.with_extension("fresh");
        let written = DemoWriter::replace(&fresh, header)
            .map_err(CliError::from)
            .and_then(|writer| Ok(record_route(self.game, &split.mode, split.first, &actions, writer)?))
            .and_then(|()| disk::rename(&fresh, &file).map_err(failed));
        if written.is_err() {
            // It is of no use, and the error says why.
            let _ = disk::remove_file(&fresh);
        }
        written
    }

    /// Returns the file of a level: its name without what a file's name may not have, and a hash of it.
    fn file(&self, level: &str) -> PathBuf {
        let plain: String =
            level.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '-' }).collect();
        let plain = &plain[plain.len().saturating_sub(60)..];
        let hash = StateHash::of(level.bytes().map(u64::from)).folded();
        self.folder.join(format!("{plain}-{hash:08x}.demo"))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn state(level: &str, outcome: LevelOutcome, count: Option<u32>) -> LevelState {
        let by = count.map(|_| "search".to_owned());
        let verdict = QuickVerdict {
            outcome: Some(outcome),
            ticks: count,
            solved_by: by,
            is_final: true,
            ..QuickVerdict::default()
        };
        LevelState { level: level.to_owned(), seconds: 0.25, verdict, before: None, problem: None, layout: None }
    }

    #[test]
    fn saves_are_there_after_a_restart_and_a_torn_line_costs_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let (mut saves, message) = Saves::open(folder.path(), false).expect("writable");
        let taken = Saves::open(folder.path(), false).err().map(|error| error.to_string());
        assert!(taken.is_some_and(|error| error.contains("is in use by another watch")));
        assert!(Saves::open(folder.path(), true).is_ok(), "a part of it");
        assert_eq!((saves.next(), message), (1, None));
        for number in 1..=3 {
            let mut save = Save::new(number);
            save.put(state("a.json", LevelOutcome::BotFailed, None));
            save.put(state("a.json", LevelOutcome::Solved, Some(100 + number as u32)));
            assert_eq!(save.levels.len(), 1);
            saves.add(save).expect("writable");
        }
        let file = folder.path().join(SAVES);
        let text = fs::read_to_string(&file).expect("written");
        fs::write(&file, &text[..text.len() - 20]).expect("writable");
        drop(saves);
        let (mut again, message) = Saves::open(folder.path(), false).expect("readable");
        assert!(message.is_some_and(|message| message.starts_with("1 line of ")), "it says so");
        assert_eq!((again.all().len(), again.next()), (2, 3));
        assert_eq!(again.last("a.json").and_then(|before| before.ticks), Some(102));
        assert_eq!(again.levels().len(), 1);
        again.add(Save { gone: vec!["a.json".to_owned()], ..Save::new(3) }).expect("writable");
        assert!(again.levels().is_empty() && folder.path().join(DAMAGED).is_file());
        drop(again);
        let (last, message) = Saves::open(folder.path(), false).expect("readable");
        assert_eq!((last.all().len(), message), (3, None), "it is reported once");
    }

    #[test]
    fn a_level_is_described_in_one_line() {
        let before = |outcome, ticks| Some(Before { outcome: Some(outcome), ticks, lost: 0 });
        let solved = LevelState {
            before: before(LevelOutcome::Solved, Some(130)),
            ..state("a.json", LevelOutcome::Solved, Some(123))
        };
        assert_eq!(solved.to_string(), "a.json: solved in 123 ticks by search (before: in 130 ticks) [0.25 s]");
        let mut lost =
            LevelState { before: before(LevelOutcome::Solved, None), ..state("a.json", LevelOutcome::BotFailed, None) };
        lost.verdict.stored = Some("is lost after 40 ticks".to_owned());
        lost.verdict.lost = 2;
        let words = "a.json: NOT SOLVED, NOTHING PROVED (before: solved); the stored solution is lost after 40 ticks; 2 deaths \
                     [0.25 s]";
        assert_eq!(lost.to_string(), words);
        let mut early = state("a.json", LevelOutcome::Solved, Some(1));
        early.verdict.solved_at_start = true;
        let words = "a.json: solved in 1 tick by search; warning: it is solved in its first tick: the agent may start at its \
                     goal [0.25 s]";
        assert_eq!(early.to_string(), words);
        let unreadable = LevelState::unreadable("b.json", "line 3: no rows".to_owned());
        assert_eq!(unreadable.to_string(), "b.json: NOT TESTED: line 3: no rows");
    }
}
