//! `playbot bisect`.

use crate::{
    error::{CliError, Outcome},
    output::{print_line, program},
    progress::interrupt,
};
use playbot_harness::brief::shell_word;
use playbot_learner::{disk, write_atomically};
use playbot_test::findings::{FindingStatus, StoredFinding};
use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    thread,
    time::Duration,
};

/// Find the commit since which a finding happens, by `git bisect` with a stored finding.
///
/// Each commit that git tries is built, and the finding is played again there. A commit that does not build, or in which the
/// finding cannot be played, is left out. Afterwards the repository is where it was. Files that were changed since the last
/// commit are refused: git would carry them from commit to commit.
///
/// The finding is played by the program that the build makes. Name it with --program if this one is installed and called by
/// its name alone.
///
/// Exit code 1 if a commit was found, or several between which those lie that cannot be tried.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot bisect runs/test/findings/NAME.finding --good v1.0 --program target/release/bots
  playbot bisect runs/test/findings/NAME.finding --good v1.0 --bad main --build \"make bots\" --program bots
  playbot bisect NAME.finding --good 3f2c1d0 --program target/debug/bots --build \"cargo build\"")]
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
    /// The program that it builds. Needed if this one is called by its name alone (default: the path that this one is
    /// called by, such as target/release/bots).
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
}

/// The middle of the line in which git names the commit. Its end depends on the version of git.
const FIRST_BAD: &str = " is the first ";

/// Exit code of `git bisect run` if only commits that cannot be tried are left.
const ONLY_SKIPPED: i32 = 2;

/// Looks for a Ctrl-C after git was cut short.
const LOOKS_FOR_STOP: u32 = 10;

/// Time between two of these looks.
const GLANCE: Duration = Duration::from_millis(20);

/// Most lines of git, or of a build that failed, that are printed.
const MOST_LINES: usize = 8;

/// Commits that are printed if each of them may be the first bad one.
const MOST_SHOWN: usize = 50;

pub fn run(args: &Args) -> Result<Outcome, CliError> {
    // It is refused before anything is built.
    StoredFinding::read(&args.finding)?;
    let program = args.program.clone().or_else(program::called_file);
    let Some(program) = program.and_then(|path| std::path::absolute(path).ok()) else {
        let name = program::name();
        return Err(CliError::Usage(format!(
            "`{name}` was called by its name alone, so the program that the build makes is not known: name it, such as \
             --program target/release/{name}"
        )));
    };
    let here = env::current_dir().map_err(|error| CliError::Io(format!("there is no current folder: {error}")))?;
    let top = PathBuf::from(git(&here, &["rev-parse", "--show-toplevel"])?.trim_end());
    let changed = git(&top, &["status", "--porcelain", "--untracked-files=no"])?;
    if !changed.is_empty() {
        return Err(CliError::Usage(format!(
            "files have changed since the last commit: commit or stash them first\n{}",
            changed.trim_end()
        )));
    }
    if top.join(git(&top, &["rev-parse", "--git-path", "BISECT_LOG"])?.trim_end()).exists() {
        return Err(CliError::Usage("a `git bisect` goes on: end it with `git bisect reset` first".to_owned()));
    }
    // The finding may be a file of some commits only.
    let folder = TemporaryFolder(env::temp_dir().join(format!("playbot-bisect-{}", std::process::id())));
    let failed = |error: std::io::Error| CliError::Io(format!("cannot write {}: {error}", folder.0.display()));
    disk::create_dir_all(&folder.0).map_err(failed)?;
    let finding = folder.0.join("bisected.finding");
    fs::read(&args.finding).and_then(|bytes| write_atomically(&finding, &bytes)).map_err(failed)?;
    interrupt::leave("`git bisect reset` goes back to where the repository was".to_owned());
    interrupt::listen();
    // The dashes end the commits: a misspelt one would be taken for a path.
    let tried = git(&top, &["bisect", "start", &args.bad, &args.good, "--"]).and_then(|_| {
        report!("each commit is built by `{}` and tried", args.build);
        let tried = Tried { folder: &here, build: &args.build, program: &program, finding: &finding, logs: &folder.0 };
        call(&top, &["bisect", "run", "sh", "-c", &tried.script()])
    });
    let is_stopped = is_stopped(&tried);
    // Also after a start that failed: git may have gone to another commit before.
    let reset = git(&top, &["bisect", "reset"]);
    if is_stopped {
        reset?;
        report!("stopped; the repository is where it was");
        return Ok(Outcome::Stopped);
    }
    let tried = tried?;
    reset?;
    if tried.status.code() == Some(ONLY_SKIPPED) {
        let said = String::from_utf8_lossy(&tried.stdout).into_owned();
        let candidates: Vec<&str> = said.lines().filter(|line| is_commit(line)).collect();
        if !candidates.is_empty() {
            report_left_out(&folder.0);
            return candidates_left(&top, &candidates);
        }
    }
    if !tried.status.success() {
        report_left_out(&folder.0);
    }
    let said = words_of(&["bisect", "run"], tried)?;
    let found = said.lines().filter_map(|line| line.split_once(FIRST_BAD)).find(|(commit, _)| is_commit(commit));
    let Some((commit, _)) = found else {
        report!("git has found no commit; it said:\n{}", said.trim_end());
        return Ok(Outcome::Pass);
    };
    print_line(described(&top, &[commit])?.trim_end())?;
    Ok(Outcome::Findings)
}

/// Returns whether Ctrl-C was pressed. The signal that ended git may come to this process a little later.
fn is_stopped(tried: &Result<Output, CliError>) -> bool {
    let is_cut = tried.as_ref().is_ok_and(|output| output.status.code().is_none_or(|code| code >= 128));
    for _ in 0..if is_cut { LOOKS_FOR_STOP } else { 0 } {
        if interrupt::asked() {
            break;
        }
        thread::park_timeout(GLANCE);
    }
    interrupt::asked_to_sum_up()
}

/// Prints commits of which one is the first bad one.
fn candidates_left(top: &Path, candidates: &[&str]) -> Result<Outcome, CliError> {
    report!(
        "the first bad commit is one of these {}: too many of them could not be built, or the finding could not be played",
        candidates.len()
    );
    let shown = &candidates[..candidates.len().min(MOST_SHOWN)];
    print_line(described(top, shown)?.trim_end())?;
    if candidates.len() > shown.len() {
        report!("and {} more", candidates.len() - shown.len());
    }
    Ok(Outcome::Findings)
}

/// Prints why the last commit was left out, with the last words of its build or replay.
fn report_left_out(logs: &Path) {
    // Commits may have been left out for another reason.
    let Ok(text) = fs::read(logs.join(LEFT_OUT)) else { return };
    let text = String::from_utf8_lossy(&text);
    let (why, said) = text.split_once('\n').unwrap_or((&text, ""));
    match last_lines(said) {
        words if words.is_empty() => report!("the last commit that was left out: {why}"),
        words => report!("the last commit that was left out: {why}:\n{words}"),
    }
}

/// Returns the last lines of a text.
fn last_lines(text: &str) -> String {
    let lines: Vec<&str> = text.trim_end().lines().collect();
    lines[lines.len().saturating_sub(MOST_LINES)..].join("\n")
}

/// Returns a line for each commit.
fn described(top: &Path, commits: &[&str]) -> Result<String, CliError> {
    let log = ["log", "--no-walk", "--format=%h %ad %an: %s", "--date=short"];
    git(top, &[&log, commits].concat())
}

/// Returns whether a text is the full name of a commit.
fn is_commit(text: &str) -> bool {
    text.len() >= 40 && text.bytes().all(|letter| letter.is_ascii_hexdigit())
}

/// A folder that is removed with the value.
struct TemporaryFolder(PathBuf);

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        // Nothing depends on it.
        let _ = disk::remove_dir_all(&self.0);
    }
}

/// Name of the file that says why the last commit was left out.
const LEFT_OUT: &str = "left-out";

/// What is done in each commit.
struct Tried<'a> {
    /// The folder in which the program is built and called.
    folder: &'a Path,
    /// The command that builds it.
    build: &'a str,
    program: &'a Path,
    finding: &'a Path,
    /// The folder for the words of builds and replays.
    logs: &'a Path,
}

impl Tried<'_> {
    /// Returns the script that git runs for each commit: it ends with 1 if the commit is bad, 0 if it is good, 125 if it
    /// cannot be tried.
    ///
    /// The exit code of `replay` does not decide, since it is 1 also for a finding that happens in another tick.
    fn script(&self) -> String {
        let word = |path: &Path| shell_word(&path.display().to_string());
        let [folder, program, finding] = [self.folder, self.program, self.finding].map(word);
        let [log, left_out] = ["log", LEFT_OUT].map(|name| word(&self.logs.join(name)));
        let [gone, unplayable] = [FindingStatus::Gone, FindingStatus::Unplayable].map(FindingStatus::name);
        // A shell of its own for the build: the exit code of a syntax error would count as bad.
        let build = shell_word(self.build);
        format!(
            "leave() {{\n\
             {{ echo \"$1 in $(git rev-parse --short HEAD)\"; cat {log}; }} >{left_out} 2>/dev/null\n\
             exit 125\n\
             }}\n\
             : >{log}\n\
             cd {folder} || leave 'the folder is not there'\n\
             sh -c {build} >{log} 2>&1 || leave 'the build failed'\n\
             said=$({program} replay {finding} --json 2>{log})\n\
             case $said in\n\
             *'\"status\":\"{gone}\"'*) exit 0 ;;\n\
             *'\"status\":\"{unplayable}\"'*) leave 'the finding could not be played' ;;\n\
             *'\"status\":\"'*) exit 1 ;;\n\
             *) leave 'the finding could not be played' ;;\n\
             esac"
        )
    }
}

/// Calls git in a folder, and returns its output.
fn git(folder: &Path, words: &[&str]) -> Result<String, CliError> {
    words_of(words, call(folder, words)?)
}

/// Calls git in a folder.
fn call(folder: &Path, words: &[&str]) -> Result<Output, CliError> {
    let called =
        Command::new("git").args(words).current_dir(folder).stdin(Stdio::null()).stderr(Stdio::piped()).output();
    called.map_err(|error| CliError::Io(format!("git does not start: {error}; `{} bisect` needs it", program::name())))
}

/// Returns the output of a git that worked, or an error with the last words of one that failed.
fn words_of(words: &[&str], output: Output) -> Result<String, CliError> {
    let Output { status, stdout, stderr } = output;
    if status.success() {
        return Ok(String::from_utf8_lossy(&stdout).into_owned());
    }
    // It says some reasons on standard output alone, such as that a commit was both good and bad.
    let said = if stderr.trim_ascii().is_empty() { stdout } else { stderr };
    let last = last_lines(&String::from_utf8_lossy(&said));
    Err(CliError::Usage(format!("`git {}` failed:\n{last}", words[..words.len().min(3)].join(" "))))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_commit_is_bad_if_the_finding_happens_in_any_tick_and_left_out_if_it_cannot_be_tried() {
        let folder = tempfile::tempdir().expect("a folder");
        let fake = folder.path().join("a bot");
        let in_folder = |game: &str, build: &str, replay: &str| {
            fs::write(&fake, format!("#!/bin/sh\n{replay}\n")).expect("writable");
            Command::new("chmod").arg("+x").arg(&fake).status().expect("a shell's chmod");
            let (game, finding) = (folder.path().join(game), Path::new("x.finding"));
            let tried = Tried { folder: &game, build, program: &fake, finding, logs: folder.path() };
            let script = tried.script();
            Command::new("sh").args(["-c", &script]).status().expect("a shell").code()
        };
        let code = |build: &str, replay: &str| in_folder("", build, replay);
        let left_out = || fs::read_to_string(folder.path().join(LEFT_OUT)).expect("it says why");
        let replay = |status: FindingStatus, exit: u8| {
            // As `replay --json` prints it: the message of a finding may hold any words.
            let json = serde_json::json!({ "message": "it's \"status\":\"gone\"", "status": status, "ticks": 3 });
            format!("cat <<'END'\n{json}\nEND\nexit {exit}")
        };
        let still_there = replay(FindingStatus::StillThere, 0);
        assert_eq!(code("true", &still_there), Some(1));
        assert_eq!(code("true", &replay(FindingStatus::Changed, 1)), Some(1), "it happens, in another tick");
        assert_eq!(code("true", &replay(FindingStatus::Gone, 1)), Some(0));
        assert_eq!(code("true", &replay(FindingStatus::Unplayable, 1)), Some(125));
        assert_eq!([code("true", "exit 1"), code("true", "exit 3")], [Some(125); 2], "it says no status");
        assert_eq!(code("false", &still_there), Some(125));
        assert!(left_out().starts_with("the build failed in "), "{}", left_out());
        assert_eq!(code("echo no linker >&2; exit 2", &still_there), Some(125));
        assert!(left_out().ends_with("\nno linker\n"), "{}", left_out());
        assert_eq!(code("echo built", "echo no game >&2"), Some(125));
        let words = left_out();
        assert!(words.starts_with("the finding could not be played in ") && words.ends_with("\nno game\n"), "{words}");
        assert_eq!(code("true; false", &still_there), Some(125), "the last command of a build decides");
        assert_eq!(code("echo (", &still_there), Some(125), "a build that is no command");
        assert_eq!(in_folder("no folder", "true", &still_there), Some(125), "the game is not there yet");
        fs::create_dir(folder.path().join("a game")).expect("writable");
        fs::write(folder.path().join("a game/made"), "").expect("writable");
        assert_eq!(in_folder("a game", "test -f made # here", &still_there), Some(1), "it is built in its folder");
    }

    #[test]
    fn what_git_says_on_standard_output_alone_is_shown() {
        let failed = |stdout: &str, stderr: &str| {
            let failed = format!("echo '{stdout}'; echo '{stderr}' >&2; exit 1");
            let output = Command::new("sh").args(["-c", &failed]).output().expect("a shell");
            words_of(&["bisect", "start", "HEAD", "HEAD"], output).expect_err("it failed").to_string()
        };
        let words = failed("0a0a was both good and bad", "");
        assert_eq!(words, "`git bisect start HEAD` failed:\n0a0a was both good and bad");
        assert_eq!(failed("status", "no such commit"), "`git bisect start HEAD` failed:\nno such commit");
        let lines: Vec<String> = (0..20).map(|line| line.to_string()).collect();
        assert_eq!(last_lines(&lines.join("\n")), lines[12..].join("\n"));
    }

    #[test]
    fn commits_are_told_from_other_lines_of_git() {
        assert!(is_commit(&"0a".repeat(20)) && is_commit(&"0a".repeat(32)));
        for line in ["", "We cannot bisect more!", &format!("[{}] commit 3", "0a".repeat(20)), "0a0a"] {
            assert!(!is_commit(line), "{line}");
        }
    }
}
