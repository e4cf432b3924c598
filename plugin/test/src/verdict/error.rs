//! Errors of tests and their results.

use crate::{findings::FindingError, verdict::shard::Shard};
use bevy_playbot::demo::file::DemoFileError;
use playbot_harness::eval::EvalError;
use playbot_learner::HasExitCode;
use playbot_report::counted;
use std::{
    io,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// Name of the journal in the folder of a test.
pub(super) const JOURNAL: &str = "levels.jsonl";

/// The remedy for damaged results.
pub(super) const MAKE_AGAIN: &str = "make it again with `playbot test`";

/// Failure to test levels, or to use results.
#[derive(Debug, Error)]
pub enum TestError {
    /// The game cannot be played, or does not support the observations of a policy.
    #[error(transparent)]
    Eval(#[from] EvalError),
    /// The test has no tester.
    #[error("the test has no tester: name a bot or a policy")]
    NoTester,
    /// Two testers share a name.
    #[error("two testers are called `{0}`: give each file or folder a name of its own, and name each bot once")]
    SameName(String),
    /// A shard without levels.
    #[error("shard {shard} has no level, since {range} has only {length}: use at most {}", shards_of(*length))]
    EmptyShard {
        /// The shard.
        shard: Shard,
        /// The range of levels.
        range: String,
        /// Number of levels.
        length: u64,
    },
    /// The folder already has results.
    #[error(
        "{} has results already: go on with --resume, choose another --out, or replace them with --force", .0.display()
    )]
    Exists(PathBuf),
    /// A file is at the path of the folder.
    #[error("{} is a file, and results need a folder: name another --out", .0.display())]
    NotAFolder(PathBuf),
    /// The folder has a finding from elsewhere, which would count as one of this test.
    #[error("{} is a finding that is not of this test: name another --out, or move the file", .0.display())]
    HasFindings(PathBuf),
    /// Another process tests into the folder.
    #[error("{} is in use by another test: wait for it or stop it, or choose another --out", .0.display())]
    Busy(PathBuf),
    /// The folder holds results of another test.
    #[error(
        "{} holds another test, which differs (there and here) in {}; use its options, or choose another --out",
        folder.display(), differences.join(", ")
    )]
    OtherPlan {
        /// The folder.
        folder: PathBuf,
        /// The differences, described.
        differences: Vec<String>,
    },
    /// The folder has no results.
    #[error("{} has no results.json{}", folder.display(), no_results(folder, resumed.as_deref()))]
    NoResults {
        /// The folder.
        folder: PathBuf,
        /// The command that goes on with its test, if one is begun there.
        resumed: Option<String>,
    },
    /// A file is damaged.
    #[error("{}, line {line}: {message}; {next}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The damage.
        message: String,
        /// The remedy.
        next: &'static str,
    },
    /// Results that cannot be joined.
    #[error(
        "{} and {} cannot be joined: {}; name shards of one test, and test the other shards again",
        first.display(), second.display(), differences.join(", ")
    )]
    Unlike {
        /// One folder.
        first: PathBuf,
        /// The other one.
        second: PathBuf,
        /// The differences, described.
        differences: Vec<String>,
    },
    /// Results of a whole range cannot be joined.
    #[error("{} holds results of a whole range, not of a shard: name folders of `playbot test --shard`", .0.display())]
    NotAShard(PathBuf),
    /// Two folders hold the same levels.
    #[error("{} and {} overlap: both are shard {shard}; name each shard once", first.display(), second.display())]
    Overlap {
        /// One folder.
        first: PathBuf,
        /// The other one.
        second: PathBuf,
        /// Their shard.
        shard: Shard,
    },
    /// Missing shards.
    #[error("missing {} with `playbot test --shard`", shards(.0))]
    Missing(Vec<Shard>),
    /// Results that cannot be compared.
    #[error(
        "{} and this test cannot be compared: {}; name results of the same version of the game with a level and a tester in common, or \
         leave --against out", folder.display(), differences.join(", ")
    )]
    Incomparable {
        /// The folder of the earlier results.
        folder: PathBuf,
        /// The differences, described.
        differences: Vec<String>,
    },
    /// A recording cannot be read, or is of another game, version or mode.
    #[error(transparent)]
    Recording(#[from] DemoFileError),
    /// A recording without a solved episode on the levels of the test.
    #[error(
        "{} has no solved episode on a level of {range}: name a recording of these levels that reaches their goals, or leave \
         --against out", path.display()
    )]
    NothingRecorded {
        /// The recording.
        path: PathBuf,
        /// The range of levels.
        range: String,
    },
    /// The variable with the date of reports is no number of seconds.
    #[error(
        "the variable SOURCE_DATE_EPOCH is `{0}`, and dates junit.xml by whole seconds since 1970: write a number such as \
         1767225600 (`git log -1 --format=%ct` prints that of a commit), or unset it"
    )]
    Date(String),
    /// A finding could not be written, or pins could not be read.
    #[error(transparent)]
    Finding(#[from] FindingError),
    /// The operating system refused.
    #[error("cannot {action} {}: {source}; {}", path.display(), next_step(source))]
    Io {
        /// The failed action.
        action: &'static str,
        /// Its file.
        path: PathBuf,
        /// The system's answer.
        source: io::Error,
    },
    /// The verdict of a level could not be written.
    #[error(
        "cannot write {}: {source}; the {finished} finished levels in it are whole: make room or grant write access there, \
         and go on with --resume", path.display()
    )]
    NotKept {
        /// The journal.
        path: PathBuf,
        /// Levels in it.
        finished: u64,
        /// The system's answer.
        source: io::Error,
    },
}

impl HasExitCode for TestError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Finding(FindingError::Pins { .. }) => 3,
            Self::Eval(EvalError::Fault(_)) | Self::Finding(_) | Self::Io { .. } | Self::NotKept { .. } => 2,
            _ => 3,
        }
    }
}

pub(super) fn io_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> TestError {
    move |source| TestError::Io { action, path: path.into(), source }
}

/// Returns serde's message about a line, with its column only: serde always counts the line as 1.
pub(super) fn json_fault(error: &serde_json::Error) -> String {
    let (words, column) = (error.to_string(), error.column());
    let place = format!(" at line {} column {column}", error.line());
    match words.strip_suffix(&place) {
        Some(what) => format!("{what} (column {column})"),
        None => words,
    }
}

/// Returns the remedy for a failure of the system.
fn next_step(source: &io::Error) -> &'static str {
    use io::ErrorKind::{
        FileTooLarge, IsADirectory, NotADirectory, NotFound, PermissionDenied, QuotaExceeded, ReadOnlyFilesystem,
        StorageFull,
    };
    match source.kind() {
        StorageFull | QuotaExceeded | FileTooLarge => "make room there and run this again",
        PermissionDenied | ReadOnlyFilesystem => "grant write access there or name another folder, and run this again",
        NotFound | NotADirectory | IsADirectory => "name another folder, or move the file that blocks it",
        _ => "run this again, and check the disk if that does not help",
    }
}

fn shards_of(levels: u64) -> String {
    counted(levels, "shard")
}

fn no_results(folder: &Path, resumed: Option<&str>) -> String {
    match resumed {
        Some(command) => format!(": its test is not done, finish it with `{command}`"),
        None if folder.exists() => ": name the --out of a `playbot test`".to_owned(),
        None => ", since there is no such folder: name the --out of a `playbot test`".to_owned(),
    }
}

fn shards(missing: &[Shard]) -> String {
    const SHOWN: usize = 8;
    let names: Vec<String> = missing.iter().take(SHOWN).map(Shard::to_string).collect();
    let more = missing.len().saturating_sub(SHOWN);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let (shards, next) = match missing.len() {
        1 => ("shard", "name its folder too, or test it"),
        _ => ("shards", "name their folders too, or test them"),
    };
    format!("{shards} {}{more}: {next}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_shards_are_named_up_to_a_few() {
        let shard = |index| Shard { index, count: 20 };
        let one = TestError::Missing(vec![shard(3)]).to_string();
        assert_eq!(one, "missing shard 3/20: name its folder too, or test it with `playbot test --shard`");
        let words = TestError::Missing((0..10).map(shard).collect()).to_string();
        assert!(words.starts_with("missing shards 0/20, 1/20,") && words.contains("7/20 and 2 more: "), "{words}");
    }

    #[test]
    fn what_the_system_refuses_has_a_next_step() {
        use io::ErrorKind::{NotFound, Other, PermissionDenied, StorageFull};
        for (kind, next) in [
            (StorageFull, "make room"),
            (PermissionDenied, "grant write access"),
            (NotFound, "name another"),
            (Other, "run this again"),
        ] {
            let words = io_error("write", Path::new("a/junit.xml"))(kind.into()).to_string();
            let (what, then) = words.rsplit_once("; ").expect("two parts");
            assert!(what.starts_with("cannot write a/junit.xml: ") && then.starts_with(next), "{words}");
        }
    }

    #[test]
    fn what_does_not_go_together_has_a_next_step_and_one_is_no_plural() {
        let differences = || vec!["games `a` and `b`".to_owned()];
        let other = TestError::Incomparable { folder: "before".into(), differences: differences() }.to_string();
        assert!(
            other.starts_with("before and this test cannot be compared: games `a` and `b`; name results"),
            "{other}"
        );
        let unlike = TestError::Unlike { first: "a".into(), second: "b".into(), differences: differences() };
        assert!(unlike.to_string().contains("games `a` and `b`; name shards of one test"), "{unlike}");
        let empty = |length| {
            let shard = Shard { index: 3, count: 7 };
            TestError::EmptyShard { shard, range: "hard:0..9".to_owned(), length }.to_string()
        };
        assert!(empty(1).ends_with("use at most 1 shard") && empty(2).ends_with("use at most 2 shards"));
    }

    #[test]
    fn an_unfinished_test_is_distinguished_from_a_folder_without_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let words = |folder: &Path, resumed: Option<&str>| {
            TestError::NoResults { folder: folder.into(), resumed: resumed.map(str::to_owned) }.to_string()
        };
        let empty = words(folder.path(), None);
        assert!(empty.contains("has no results.json: name the --out"), "{empty}");
        let none = words(&folder.path().join("none"), None);
        assert!(none.contains("no such folder"), "{none}");
        let begun = words(folder.path(), Some("playbot test a --out b --resume"));
        assert!(begun.ends_with(": its test is not done, finish it with `playbot test a --out b --resume`"), "{begun}");
    }
}
