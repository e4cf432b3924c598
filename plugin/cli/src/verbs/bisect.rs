//! `playbot bisect`.

use crate::{
    error::{CliError, Outcome},
    output::{print_line, program},
    progress::interrupt,
};
use playbot_harness::brief::shell_word;
use playbot_learner::{disk, write_atomically};
use playbot_test::findings::StoredFinding;
use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};

/// Find the commit since which a finding happens, by `git bisect` with a stored finding.
///
/// Each commit that git tries is built, and the finding is played again there. A commit that does not build, or in which the
/// finding cannot be played, is left out. Afterwards the repository is where it was. Files that were changed since the last
/// commit are refused: git would carry them from commit to commit.
///
/// Exit code 1 if a commit was found.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot bisect runs/test/findings/NAME.finding --good v1.0
  playbot bisect runs/test/findings/NAME.finding --good v1.0 --bad main --build \"cargo build --release\"
  playbot bisect NAME.finding --good 3f2c1d0 --program target/release/bots")]
pub struct Args {
    /// File of the finding.
    finding: PathBuf,
    /// A commit in which it does not happen.
    #[arg(long, value_name = "COMMIT")]
    good: String,
    /// A later commit in which it happens.
    #[arg(long, value_name = "COMMIT", default_value = "HEAD")]
    bad: String,
    /// Command that builds the program. It runs in a shell, in the current folder.
    #[arg(long, value_name = "COMMAND", default_value = "cargo build --release")]
    build: String,
    /// The program that it builds (default: this one).
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
}

/// Beginning and end of the line in which git names the commit.
const FIRST_BAD: &str = " is the first bad commit";

pub fn run(args: &Args) -> Result<Outcome, CliError> {
    // It is refused before anything is built.
    StoredFinding::read(&args.finding)?;
    let own = || env::args_os().next().map(PathBuf::from).filter(|path| path.is_file());
    let program = args.program.clone().or_else(own);
    let Some(program) = program.and_then(|path| std::path::absolute(path).ok()) else {
        return Err(CliError::Usage("name the program that the build makes with --program".to_owned()));
    };
    let changed = git(&["status", "--porcelain", "--untracked-files=no"])?;
    if !changed.is_empty() {
        return Err(CliError::Usage(format!(
            "files have changed since the last commit: commit or stash them first\n{}",
            changed.trim_end()
        )));
    }
    // The finding may be a file of some commits only.
    let folder = env::temp_dir().join(format!("playbot-bisect-{}", std::process::id()));
    let failed = |error: std::io::Error| CliError::Io(format!("cannot write {}: {error}", folder.display()));
    disk::create_dir_all(&folder).map_err(failed)?;
    let finding = folder.join("bisected.finding");
    fs::read(&args.finding).and_then(|bytes| write_atomically(&finding, &bytes)).map_err(failed)?;
    interrupt::leave("`git bisect reset` goes back to where the repository was".to_owned());
    git(&["bisect", "start", &args.bad, &args.good])?;
    report!("each commit is built by `{}` and tried", args.build);
    let found = git(&["bisect", "run", "sh", "-c", &script(&args.build, &program, &finding)]);
    let reset = git(&["bisect", "reset"]);
    let _ = disk::remove_dir_all(&folder);
    let said = found?;
    reset?;
    let Some(commit) = said.lines().find_map(|line| line.strip_suffix(FIRST_BAD)) else {
        report!("git has found no commit; it said:\n{}", said.trim_end());
        return Ok(Outcome::Pass);
    };
    print_line(git(&["log", "-1", "--format=%h %ad %an: %s", "--date=short", commit])?.trim_end())?;
    Ok(Outcome::Findings)
}

/// Returns the script that tells git whether a commit is bad (1), good (0), or cannot be tried (125).
fn script(build: &str, program: &Path, finding: &Path) -> String {
    let [program, finding] = [program, finding].map(|path| shell_word(&path.display().to_string()));
    format!(
        "( {build} ) >&2 || exit 125\n{program} replay {finding} >&2\ncase $? in 0) exit 1 ;; 1) exit 0 ;; *) exit 125 ;; esac"
    )
}

/// Calls git and returns what it says.
fn git(words: &[&str]) -> Result<String, CliError> {
    let called = Command::new("git").args(words).stdin(Stdio::null()).stderr(Stdio::piped()).output();
    let Output { status, stdout, stderr } = called
        .map_err(|error| CliError::Io(format!("git does not start: {error}; `{} bisect` needs it", program::name())))?;
    if status.success() {
        return Ok(String::from_utf8_lossy(&stdout).into_owned());
    }
    let said = String::from_utf8_lossy(&stderr);
    // What builds and replays say comes before git's own words.
    let last: Vec<&str> = said.trim_end().lines().rev().take(8).collect();
    let last: Vec<&str> = last.into_iter().rev().collect();
    Err(CliError::Usage(format!("`git {}` failed:\n{}", words[..words.len().min(3)].join(" "), last.join("\n"))))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_commit_is_bad_if_the_finding_happens_and_left_out_if_it_cannot_be_tried() {
        let folder = tempfile::tempdir().expect("a folder");
        let fake = folder.path().join("a bot");
        let code = |build: &str, replay: i32| {
            fs::write(&fake, format!("#!/bin/sh\nexit {replay}\n")).expect("writable");
            Command::new("chmod").arg("+x").arg(&fake).status().expect("a shell's chmod");
            let script = script(build, &fake, Path::new("x.finding"));
            Command::new("sh").args(["-c", &script]).status().expect("a shell").code()
        };
        assert_eq!([code("true", 0), code("true", 1), code("true", 3)], [Some(1), Some(0), Some(125)]);
        assert_eq!(code("false", 0), Some(125));
        assert_eq!(code("true; false", 0), Some(125), "the last command of a build decides");
    }
}
