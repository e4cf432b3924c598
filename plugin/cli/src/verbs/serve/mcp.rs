//! Sessions of language models: their options, and the detectors of `playbot test` at their episodes.

use crate::{
    error::{CliError, Outcome},
    output::{DataStream, make_folder, program},
    progress::interrupt,
};
use bevy_playbot::action::ActionValue;
use playbot_bridge::{
    lockstep::Settings,
    mcp::{Bounds, Examiner, FoundInEpisode, PlayedEpisode, Server, SessionEnd},
};
use playbot_harness::{
    brief::shell_word,
    game::{Game, level_designs, prove_level},
    level_files::{is_level_files, level_files_mode},
    split::LevelSplit,
};
use playbot_learner::disk;
use playbot_test::{
    detectors::Detectors,
    findings::{Checks, FINDINGS, FindingHead, REPORT, StoredFinding, recheck, scan},
    verdict::level_name,
};
use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

/// A language model as the client.
#[derive(clap::Args, Clone, Debug)]
pub(super) struct ModelArgs {
    /// Let a language model play: speak the Model Context Protocol over standard input and output.
    #[arg(long, conflicts_with_all = ["transport", "listen", "once", "autoreset"])]
    pub(super) mcp: bool,
    /// Most ticks of the session.
    #[arg(long, requires = "mcp", value_name = "TICKS", default_value_t = Bounds::default().ticks, value_parser = clap::value_parser!(u64).range(1..))]
    max_steps: u64,
    /// Longest time of the session.
    #[arg(long, requires = "mcp", value_name = "SECONDS", default_value_t = Bounds::default().time.as_secs(), value_parser = clap::value_parser!(u64).range(1..))]
    max_seconds: u64,
    /// Most ticks of one call.
    #[arg(long, requires = "mcp", value_name = "TICKS", default_value_t = Bounds::default().ticks_per_call, value_parser = clap::value_parser!(u64).range(1..))]
    max_ticks_per_call: u64,
    /// In a game of several agents, play the first one alone, while the others play along as in tests. Only then recordings
    /// replay, and detectors look.
    #[arg(long, requires = "mcp")]
    pub(super) first_seat: bool,
    /// Folder for the recording and the findings of the session, which is new or empty (default: runs/mcp, or with the next
    /// free number).
    #[arg(long, requires = "mcp", value_name = "DIR")]
    out: Option<PathBuf>,
}

impl ModelArgs {
    /// Makes the folder of the session.
    fn folder(&self) -> Result<PathBuf, CliError> {
        let folder = match &self.out {
            Some(folder) if fs::read_dir(folder).is_ok_and(|mut files| files.next().is_some()) => {
                return Err(CliError::Usage(format!(
                    "{} is not empty: name a new folder with --out, or leave it out",
                    folder.display()
                )));
            }
            Some(folder) => folder.clone(),
            None => {
                let numbered = (2..).map(|number: u32| PathBuf::from(format!("runs/mcp-{number}")));
                let mut free = std::iter::once(PathBuf::from("runs/mcp")).chain(numbered);
                free.find(|folder| !folder.exists()).unwrap_or_default()
            }
        };
        make_folder(&folder)?;
        Ok(folder)
    }
}

pub(super) fn run(args: &ModelArgs, settings: &Settings<'_>) -> Result<Outcome, CliError> {
    let game = settings.game;
    let folder = args.folder()?;
    let detectors = Detectors::defaults(game);
    let examiner = TestExaminer {
        game,
        levels: &settings.levels,
        folder: &folder,
        checks: Checks::default().with_detectors(&detectors),
        detectors,
    };
    interrupt::listen();
    interrupt::leave(format!("the episodes that have ended are kept in {}", folder.display()));
    report!("a model's client speaks over standard input and output; the session is recorded in {}", folder.display());
    let server = Server {
        settings,
        bounds: Bounds {
            ticks: args.max_steps,
            time: Duration::from_secs(args.max_seconds),
            ticks_per_call: args.max_ticks_per_call,
        },
        folder: &folder,
        examiner: &examiner,
        stops: &interrupt::asked,
        report: &|line| report!("{}", program::named(line)),
    };
    let ended = server.run(std::io::stdin(), &mut DataStream);
    let ended = ended.map_err(|error| CliError::Io(format!("the session is not recorded to its end: {error}")))?;
    say(&ended, &folder);
    Ok(if interrupt::asked() { Outcome::Stopped } else { Outcome::Pass })
}

/// Reports what is left of a session, with the commands that show it.
fn say(ended: &SessionEnd, folder: &Path) {
    report!("the session is over: {ended}");
    let (program, folder) = (program::name(), shell_word(&folder.display().to_string()));
    if ended.recording.as_ref().is_some_and(|file| file.extension().is_some_and(|ending| ending == "demo")) {
        report!("`{program} demo verify {folder}` plays it again");
    }
    if ended.findings > 0 {
        report!("`{program} test --regress {folder}` plays the findings again");
    }
}

/// The detectors of a test at the episodes of a session. Findings are written as a test writes them.
struct TestExaminer<'a> {
    game: &'a dyn Game,
    levels: &'a LevelSplit,
    folder: &'a Path,
    detectors: Detectors,
    checks: Checks,
}

impl TestExaminer<'_> {
    /// Returns mode and number of a level alone. For a level file they do not depend on other files.
    fn alone(&self, level: u64, name: &str) -> (String, u64) {
        if is_level_files(&self.levels.mode) {
            let mode = level_files_mode(name);
            if level_designs(self.game, &mode).is_ok() {
                return (mode, 0);
            }
        }
        (self.levels.mode.clone(), level)
    }

    /// Plays the actions that lead to a finding again, twice, and writes it.
    ///
    /// # Errors
    ///
    /// The outer one: the file cannot be written. The inner one: the finding does not happen again.
    fn write(
        &self,
        head: FindingHead,
        (mode, level): (&str, u64),
        actions: &[ActionValue],
    ) -> Result<Result<PathBuf, String>, String> {
        const ELSEWHERE: &str = "it does not happen when its actions are played again: the game is not deterministic";
        let Some(found) = StoredFinding::of_actions(self.game, mode, level, head, actions, &self.checks) else {
            return Ok(Err(ELSEWHERE.to_owned()));
        };
        match recheck(self.game, &found, &self.checks) {
            Ok(again) if again.is_same(&found) => {}
            Ok(_) => return Ok(Err(ELSEWHERE.to_owned())),
            Err(unplayable) => return Ok(Err(unplayable.to_string())),
        }
        let folder = self.folder.join(FINDINGS);
        let path = folder.join(found.file_name());
        disk::create_dir_all(&folder).map_err(|error| format!("cannot create {}: {error}", folder.display()))?;
        found.write(&path).map_err(|error| error.to_string())?;
        Ok(Ok(path))
    }
}

impl Examiner for TestExaminer<'_> {
    fn examine(&self, episode: &PlayedEpisode, tester: &str) -> Result<Vec<FoundInEpisode>, String> {
        let Some(played) = episode.agents.first() else { return Ok(Vec::new()) };
        let name = level_name(self.game, self.levels, episode.level);
        let (mode, level) = self.alone(episode.level, &name);
        let actions = &played.actions;
        let seen = scan(self.game, &mode, level, 0, actions, &self.detectors).seen;
        let mut found = Vec::new();
        for seen in seen {
            let tester = Some(tester.to_owned());
            let head = FindingHead { tester, ..FindingHead::new(&name, seen.detector, &seen.message) };
            let file = self.write(head, (&mode, level), actions)?;
            let (detector, message) = (seen.detector.to_owned(), seen.message);
            found.push(FoundInEpisode { detector, tick: Some(seen.tick), message, file });
        }
        // As in tests, of levels that were not solved.
        let proof = (!played.success).then(|| prove_level(self.game, &mode, level));
        if let Some(why) = proof.as_ref().and_then(|proof| proof.why_unsolvable()) {
            let detector = "unreachable-goal";
            let file = self.write(FindingHead::new(&name, detector, why), (&mode, level), &[])?;
            found.push(FoundInEpisode { detector: detector.to_owned(), tick: None, message: why.to_owned(), file });
        }
        Ok(found)
    }

    fn store(&self, episode: &PlayedEpisode, tick: u32, words: &str, tester: &str) -> Result<FoundInEpisode, String> {
        let played = episode.agents.first();
        let state = played.and_then(|played| Some((played, played.states.get(tick as usize)?)));
        let Some((played, state)) = state else { return Err(format!("tick {tick} was not played to its end")) };
        let name = level_name(self.game, self.levels, episode.level);
        let (mode, level) = self.alone(episode.level, &name);
        // A head is one line for people.
        let words: String = words.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect();
        let head = FindingHead {
            tester: Some(tester.to_owned()),
            tick: Some(tick),
            state_hash: Some(state.folded()),
            ..FindingHead::new(name, REPORT, &words)
        };
        let file = self.write(head, (&mode, level), &played.actions)?;
        Ok(FoundInEpisode { detector: REPORT.to_owned(), tick: Some(tick), message: words, file })
    }
}
