//! Lessons: another program learns from a recording in the background, while the game goes on.
//!
//! The program is one with playbot's verbs and this game; it is run as
//! `PROGRAM teach GAME --demos FILE --out FOLDER --json --until-input-ends`. It prints a line of JSON for each
//! [`LessonNews`], keeps what it has learned in its folder, and goes on there if it is started again. It stops as
//! soon as its input ends, so that it never outlives the game, however the game ends.
//!
//! ```no_run
//! use bevy_playbot::lesson::{Lesson, LessonNews, lesson_command};
//! use std::process::Command;
//!
//! let mut lesson = Lesson::begin(lesson_command(Command::new("target/release/bots"), "walk", "walk.demo".as_ref()))?;
//! // In each frame:
//! if let Some(LessonNews::Policy { file, .. }) = LessonNews::newest_policy(&lesson.news()) {
//!     println!("{} plays better than what was there before", file.display());
//! }
//! # Ok::<(), bevy_playbot::lesson::LessonError>(())
//! ```

use playbot_learner::HasExitCode;
use serde::{Deserialize, Serialize};
use std::{
    fmt, io,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
    sync::{
        Mutex, PoisonError,
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    thread,
    time::{Duration, Instant},
};
use thiserror::Error;

/// Longest time for which the end of the game waits for a lesson that saves its state.
const PATIENCE: Duration = Duration::from_secs(3);

/// News of a lesson, a line of JSON each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "event")]
pub enum LessonNews {
    /// It has come further.
    Progress {
        /// What it does.
        stage: LessonStage,
        /// Units done: recorded ticks, batches, or ticks of training.
        done: u64,
        /// Units in all.
        of: u64,
        /// Mean return of the last episodes of training, if any has ended.
        mean_return: Option<f64>,
    },
    /// A policy that can play was written. It replaces the one before it.
    Policy {
        /// The file.
        file: PathBuf,
        /// What it was learned by.
        stage: LessonStage,
        /// Ticks of training.
        steps: u64,
        /// Mean return of its last episodes in training; `None` before any has ended.
        mean_return: Option<f64>,
    },
    /// It has learned for as long as it was asked to.
    Finished,
    /// It stopped before that, and has saved its state.
    Stopped,
    /// It failed. What it had written stays.
    Failed {
        /// The reason.
        why: String,
    },
}

impl LessonNews {
    /// Returns the last policy among the news, as it stands there.
    pub fn newest_policy(news: &[Self]) -> Option<&Self> {
        news.iter().rev().find(|one| matches!(one, Self::Policy { .. }))
    }
}

/// Completes the command of a lesson on a recording of a game: `program` with its first arguments. The lesson keeps what it
/// has learned beside the recording, in a folder of the same name with the ending `lessons`. It leaves one core to the game.
pub fn lesson_command(mut program: Command, game: &str, recording: &Path) -> Command {
    program.args(["teach", game, "--json", "--until-input-ends", "--demos"]).arg(recording);
    program.arg("--out").arg(recording.with_extension("lessons"));
    let threads = thread::available_parallelism().map_or(1, |cores| cores.get().saturating_sub(1).max(1));
    program.arg("--threads").arg(threads.to_string());
    program
}

/// A stage of a lesson.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LessonStage {
    /// The recorded episodes are replayed.
    Replay,
    /// Behaviour cloning: skills are learned from the recorded actions.
    Imitation,
    /// SCORE-PPO on copies of the game.
    Training,
}

impl fmt::Display for LessonStage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Replay => "replay",
            Self::Imitation => "imitation",
            Self::Training => "training",
        })
    }
}

impl fmt::Display for LessonNews {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of_return = |mean: &Option<f64>| mean.map_or_else(String::new, |mean| format!(", return {mean:.1}"));
        match self {
            Self::Progress { stage, done, of, mean_return } => {
                write!(f, "{stage} {} %{}", done * 100 / (*of).max(1), of_return(mean_return))
            }
            Self::Policy { stage, mean_return, .. } => write!(f, "learned by {stage}{}", of_return(mean_return)),
            Self::Finished => write!(f, "learned to the end"),
            Self::Stopped => write!(f, "stopped and saved"),
            Self::Failed { why } => write!(f, "failed: {why}"),
        }
    }
}

/// Failure to begin a lesson.
#[derive(Debug, Error)]
pub enum LessonError {
    /// The program cannot be started.
    #[error("`{program}` cannot be started: {source}; it must be a program with playbot's verbs and this game")]
    Start {
        /// The program.
        program: String,
        /// The reason.
        source: io::Error,
    },
}

impl HasExitCode for LessonError {
    fn exit_code(&self) -> u8 {
        3
    }
}

/// A lesson that is under way. Dropping it ends the program's input and waits, for three seconds at most, until it has
/// saved its state.
#[derive(Debug)]
pub struct Lesson {
    child: Child,
    /// Its end asks the program to stop.
    input: Option<ChildStdin>,
    heard: Mutex<Receiver<Heard>>,
    /// The last line that is no news, such as an error.
    last_line: String,
    is_over: bool,
}

/// A line of the program.
#[derive(Debug)]
enum Heard {
    News(LessonNews),
    Line(String),
}

impl Lesson {
    /// Starts the program.
    ///
    /// # Errors
    ///
    /// [`LessonError::Start`].
    pub fn begin(mut command: Command) -> Result<Self, LessonError> {
        let program = command.get_program().to_string_lossy().into_owned();
        let spawned = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        let mut child = spawned.map_err(|source| LessonError::Start { program, source })?;
        let (send, heard) = channel();
        if let Some(output) = child.stdout.take() {
            listen(output, send.clone());
        }
        if let Some(errors) = child.stderr.take() {
            listen(errors, send);
        }
        let input = child.stdin.take();
        Ok(Self { child, input, heard: Mutex::new(heard), last_line: String::new(), is_over: false })
    }

    /// Returns the news since the last call. The last of all is [`Finished`](LessonNews::Finished),
    /// [`Stopped`](LessonNews::Stopped) or [`Failed`](LessonNews::Failed).
    pub fn news(&mut self) -> Vec<LessonNews> {
        let mut news = Vec::new();
        if self.is_over {
            return news;
        }
        let is_quiet = loop {
            let heard = self.heard.get_mut().unwrap_or_else(PoisonError::into_inner);
            match heard.recv_timeout(Duration::ZERO) {
                Ok(Heard::News(one)) => news.push(one),
                Ok(Heard::Line(line)) => self.last_line = line,
                Err(RecvTimeoutError::Timeout) => break false,
                Err(RecvTimeoutError::Disconnected) => break true,
            }
        };
        let has_end = news.iter().any(|one| matches!(one, LessonNews::Finished | LessonNews::Stopped));
        if has_end || is_quiet {
            self.is_over = true;
        }
        if is_quiet && !has_end {
            let code = self.child.wait().ok().and_then(|status| status.code());
            let why = match (self.last_line.trim(), code) {
                ("", Some(code)) => format!("the program ended with exit code {code}"),
                ("", None) => "the program was killed".to_owned(),
                (line, _) => line.to_owned(),
            };
            news.push(LessonNews::Failed { why });
        }
        news
    }

    /// Returns whether its last news was heard.
    pub fn is_over(&self) -> bool {
        self.is_over
    }

    /// Asks the program to save its state and to stop. Its last news is then [`Stopped`](LessonNews::Stopped).
    pub fn stop(&mut self) {
        self.input = None;
    }
}

impl Drop for Lesson {
    fn drop(&mut self) {
        self.stop();
        let heard = self.heard.get_mut().unwrap_or_else(PoisonError::into_inner);
        let end = Instant::now() + PATIENCE;
        // The program is gone when nothing can be heard of it any more.
        while heard.recv_timeout(end.saturating_duration_since(Instant::now())).is_ok() {}
        // Frees the entry of a program that has ended. One that has not ends without us.
        let _ = self.child.try_wait();
    }
}

/// Hears each line on a thread of its own, until there are no more.
fn listen(from: impl io::Read + Send + 'static, send: Sender<Heard>) {
    thread::spawn(move || {
        for line in BufReader::new(from).split(b'\n').map_while(Result::ok) {
            // Words in another encoding are still words.
            let line = String::from_utf8_lossy(&line).into_owned();
            if line.trim().is_empty() {
                continue;
            }
            let heard = serde_json::from_str(&line).map_or_else(|_| Heard::Line(line), Heard::News);
            if send.send(heard).is_err() {
                return;
            }
        }
    });
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// Returns all news of a shell that runs this, until the lesson is over.
    fn all(script: &str, until: impl Fn(&mut Lesson)) -> Vec<LessonNews> {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        let mut lesson = Lesson::begin(command).expect("there is a shell");
        until(&mut lesson);
        let mut news = Vec::new();
        while !lesson.is_over() {
            news.extend(lesson.news());
            thread::yield_now();
        }
        news
    }

    #[test]
    fn news_reads_back_and_the_last_one_ends_it() {
        let policy = LessonNews::Policy {
            file: "a b.policy".into(),
            stage: LessonStage::Training,
            steps: 7,
            mean_return: Some(2.5),
        };
        let line = serde_json::to_string(&policy).expect("serialises");
        let script = format!("echo words; echo '{line}'; echo '{{\"event\":\"finished\"}}'");
        assert_eq!(all(&script, |_| {}), [policy.clone(), LessonNews::Finished]);
        assert_eq!(policy.to_string(), "learned by training, return 2.5");
    }

    #[test]
    fn a_program_that_fails_says_why_in_its_last_line() {
        let failed = |why: &str| vec![LessonNews::Failed { why: why.to_owned() }];
        assert_eq!(all("echo first >&2; echo 'no room' >&2; exit 2", |_| {}), failed("no room"));
        assert_eq!(all("exit 4", |_| {}), failed("the program ended with exit code 4"));
        let error = Lesson::begin(Command::new("/nowhere/bots")).expect_err("no such program").to_string();
        assert!(error.contains("`/nowhere/bots` cannot be started"), "{error}");
    }

    #[test]
    fn the_end_of_its_input_asks_it_to_stop() {
        let script = "cat > /dev/null; echo '{\"event\":\"stopped\"}'";
        assert_eq!(all(script, Lesson::stop), [LessonNews::Stopped]);
        // Dropped while it runs: it still ends, and is waited for.
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        drop(Lesson::begin(command).expect("there is a shell"));
    }
}
