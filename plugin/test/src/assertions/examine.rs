//! The testers of an assertion, and their run over its levels.

use crate::{
    assertions::{DEFAULT_PROGRAM, LevelTest, Wanted},
    detectors::{DetectorChoice, DetectorError, Detectors},
    findings::{Budget, Checks, FindingError, FindingFiles, Played, SeenFinding, SeenLevel},
    verdict::{
        Finding, LevelVerdict, TestError, TestObserver, TestPlan, TestRecord, Tester, TesterRecord, TesterVerdict,
        rerun_commands, run_tests,
    },
};
use bevy_playbot::{
    engine::policy_observation,
    policy::ActionDraw,
    policy_file::{PolicyMisfit, check_policy},
    unknown_name::UnknownName,
    vision::{ObservationConfig, UnknownObservation, VisionError},
};
use playbot_harness::{
    brief::shell_word,
    eval::{Player, all_bots},
    game::Game,
    level_files::is_level_files,
    mode::ModeError,
    sealed_file::{SealedFileError, file_checksum},
    sensors::GameSensors,
    split::{LevelSplit, SplitError},
};
use playbot_learner::{DeviceKind, FileError, PolicyFile};
use playbot_report::counted;
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};
use thiserror::Error;

/// Only one test of a process plays at a time: each takes all cores, and two may write the same finding.
static PLAYING: Mutex<()> = Mutex::new(());

impl LevelTest<'_> {
    /// Returns the verdicts on all levels.
    pub(super) fn all(&self) -> Result<Vec<LevelVerdict>, LevelTestError> {
        let _alone = PLAYING.lock().unwrap_or_else(PoisonError::into_inner);
        let plan = self.plan(Wanted::Nothing)?;
        self.broken(&plan, Wanted::Nothing)
    }

    /// Checks whether the assertion holds, and returns the message of its failure if not.
    pub(super) fn check(&self, wanted: Wanted) -> Result<(), String> {
        match self.failure(wanted) {
            Ok(None) => Ok(()),
            Ok(Some(failure)) => Err(failure),
            Err(error) => Err(match self.levels.as_str() {
                "" => format!("cannot test `{}`: {error}", self.game.name()),
                levels => format!("cannot test {levels} of `{}`: {error}", self.game.name()),
            }),
        }
    }

    /// Returns the message of a failure, if there is one.
    fn failure(&self, wanted: Wanted) -> Result<Option<String>, LevelTestError> {
        let _alone = PLAYING.lock().unwrap_or_else(PoisonError::into_inner);
        let plan = self.plan(wanted)?;
        let mut broken = self.broken(&plan, wanted)?;
        if broken.is_empty() {
            return Ok(None);
        }
        let evidence = Evidence::new(self.game, &plan, wanted, &self.folder, self.minimise);
        let kept: Result<Vec<_>, _> = broken.iter_mut().take(MOST_SHOWN).map(|level| evidence.keep(level)).collect();
        let commands = self.commands(&plan);
        let (episodes, folder) = (kept?, self.folder.as_path());
        Ok(Some(Failure { wanted, plan: &plan, broken: &broken, episodes: &episodes, folder, commands }.text()))
    }

    fn commands(&self, plan: &TestPlan) -> Commands<'_> {
        let mut record = plan.record(self.game);
        record.testers.retain(|tester| self.named.iter().all(|named| named.own_name() != Some(tester.name.as_str())));
        let policies = self.named.iter().zip(&plan.testers).filter_map(|(named, tester)| match named {
            Named::Policy { path, .. } => Some((tester.record.name.clone(), path.display().to_string())),
            Named::Bot(_) | Named::Player { .. } => None,
        });
        Commands { program: &self.program, record, policies: policies.collect() }
    }

    /// Returns the levels for which the assertion does not hold, in their order.
    fn broken(&self, plan: &TestPlan, wanted: Wanted) -> Result<Vec<LevelVerdict>, LevelTestError> {
        let mut broken = Vec::new();
        let mut keep = |level: LevelVerdict| -> Result<(), TestError> {
            if !wanted.holds(&level) {
                broken.push(level);
            }
            Ok(())
        };
        let watch = TestObserver { progress: &|_| {}, stop: &|| false };
        run_tests(self.game, plan, &BTreeSet::new(), &mut keep, &watch)?;
        broken.sort_by_key(|level| level.index);
        Ok(broken)
    }

    fn plan(&self, wanted: Wanted) -> Result<TestPlan, LevelTestError> {
        if self.levels.is_empty() {
            return Err(LevelTestError::NoLevels);
        }
        let split: LevelSplit = self.levels.parse()?;
        split.check(self.game)?;
        let plan = TestPlan {
            split,
            testers: self.testers(wanted)?,
            episodes: self.episodes,
            seed: self.seed,
            detectors: Detectors::choose(self.game, &self.choice(wanted))?,
            shard: None,
            threads: self.threads,
        };
        plan.check()?;
        Ok(plan)
    }

    fn testers(&self, wanted: Wanted) -> Result<Vec<Tester>, LevelTestError> {
        if !self.named.is_empty() {
            return self.named.iter().map(|named| named.tester(self.game)).collect();
        }
        let bots = all_bots(self.game);
        let count = if matches!(wanted, Wanted::NoFindings | Wanted::Deterministic) { bots.len() } else { 1 };
        if bots.is_empty() {
            return Err(LevelTestError::NoBot(self.game.name()));
        }
        Ok(bots.into_iter().take(count).map(|(name, player)| of_player(name, player)).collect())
    }

    /// Returns the selected detectors, or `determinism` alone for [`Wanted::Deterministic`].
    fn choice(&self, wanted: Wanted) -> DetectorChoice {
        let mut choice = self.detectors.clone();
        if wanted == Wanted::Deterministic {
            choice.with.push("determinism".to_owned());
            choice.without.push("all".to_owned());
            let default = ["determinism.every=1", "determinism.ticks=100000"].map(str::to_owned);
            // Explicit settings come last, and win.
            choice.settings = default.into_iter().chain(choice.settings).collect();
        }
        choice
    }
}

/// Most episodes of a tester that are replayed to find a failed one.
const MOST_TRIES: u32 = 16;

/// The files that are kept of broken levels.
pub(super) struct Evidence<'a> {
    game: &'a dyn Game,
    plan: &'a TestPlan,
    wanted: Wanted,
    files: FindingFiles,
}

impl<'a> Evidence<'a> {
    /// Creates the writer for this folder, with or without minimisation of the findings.
    pub fn new(game: &'a dyn Game, plan: &'a TestPlan, wanted: Wanted, folder: &Path, minimise: bool) -> Self {
        let files = FindingFiles {
            folder: folder.to_owned(),
            minimise: minimise.then(Budget::default),
            keep_failures: true,
            checks: Checks::default().with_detectors(&plan.detectors),
        };
        Self { game, plan, wanted, files }
    }

    /// Writes the findings of a level, and names the files in it. Also returns the file of a failed episode, if the
    /// assertion is about solving and no finding shows it.
    pub fn keep(&self, verdict: &mut LevelVerdict) -> Result<Option<String>, FindingError> {
        let LevelVerdict { level: name, index, testers, findings, .. } = verdict;
        let level = SeenLevel { mode: &self.plan.split.mode, level: self.plan.split.first + *index, name };
        let played = |tester: &str, episode| self.played(level.name, tester, episode);
        for finding in findings.iter_mut() {
            let who = finding.tester.as_deref().zip(finding.episode);
            let played = who.and_then(|(tester, episode)| played(tester, episode));
            let seen = SeenFinding {
                detector: &finding.detector,
                message: &finding.message,
                settings: &finding.settings,
                played,
            };
            finding.file = self.files.keep(self.game, level, &seen)?;
        }
        let is_shown = findings.iter().any(|finding| finding.file.is_some() && finding.tester.is_some());
        if is_shown || !self.wanted.is_about_solving() {
            return Ok(None);
        }
        for tester in testers.iter().filter(|tester| tester.score.lost + tester.score.timed_out > 0) {
            for played in
                (0..self.plan.episodes.clamp(1, MOST_TRIES)).filter_map(|number| played(&tester.tester, number))
            {
                let file = self.files.keep_failure(self.game, level, played)?.file();
                if file.is_some() {
                    return Ok(file);
                }
            }
        }
        Ok(None)
    }

    /// Returns an episode of a tester on a level.
    fn played(&self, level: &str, tester: &str, episode: u32) -> Option<Played<'a>> {
        let tester = self.plan.testers.iter().find(|known| known.record.name == tester)?;
        let Tester { record, player, observation_config } = tester;
        let seed = self.plan.episode_seed(record, level, episode);
        Some(Played { tester: &record.name, player, observation_config, seed })
    }
}

/// Most broken levels that are listed in full.
pub(super) const MOST_SHOWN: usize = 10;

/// Most further levels that are named.
const MOST_NAMED: usize = 200;

/// Most findings of a level that are listed.
const MOST_FINDINGS: usize = 5;

/// The failure message of an assertion.
pub(super) struct Failure<'a> {
    /// The assertion.
    pub wanted: Wanted,
    /// The test.
    pub plan: &'a TestPlan,
    /// The broken levels, in their order.
    pub broken: &'a [LevelVerdict],
    /// For each of the first of them, an episode that failed.
    pub episodes: &'a [Option<String>],
    /// The folder that paths of files start from.
    pub folder: &'a Path,
    /// The commands.
    pub commands: Commands<'a>,
}

impl Failure<'_> {
    /// Returns the message.
    pub fn text(&self) -> String {
        let mut lines = vec![self.headline()];
        for (level, episode) in self.broken.iter().zip(self.episodes) {
            lines.extend(self.level(level, episode.as_deref()));
        }
        let rest = self.broken.get(self.episodes.len()..).unwrap_or_default();
        if !rest.is_empty() {
            let names: Vec<String> = rest.iter().take(MOST_NAMED).map(LevelVerdict::title).collect();
            let more = rest.len().saturating_sub(MOST_NAMED);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            lines.push(format!("and {}{more}", names.join(", ")));
        }
        let has_files = self.broken.iter().flat_map(|level| &level.findings).any(|finding| finding.file.is_some());
        // The test may be all that the game has of playbot.
        if self.commands.program == DEFAULT_PROGRAM && (has_files || self.episodes.iter().any(Option::is_some)) {
            lines.push(
                "without a program that has the game: `playbot::test(&game).assert_replays(\"FILE\")` in a test plays such \
                 a file again"
                    .to_owned(),
            );
        }
        if is_level_files(&self.plan.split.mode) {
            let folder = std::env::current_dir().unwrap_or_else(|_| PathBuf::from("."));
            lines.push(format!("files of levels are seen from {}", folder.display()));
        }
        lines.join("\n")
    }

    fn headline(&self) -> String {
        let record = &self.commands.record;
        let testers: Vec<&str> = self.plan.testers.iter().map(|tester| tester.record.name.as_str()).collect();
        let episodes = format!("{} each", counted(self.plan.episodes.max(1).into(), "episode"));
        let complaint = self.wanted.complaint(self.broken.len(), self.plan.split.len());
        let (game, range, seed) = (&record.game, &record.range, record.seed);
        format!("{complaint} (`{game}`, {range}, {}, {episodes}, seed {seed}):", testers.join(" + "))
    }

    fn level(&self, level: &LevelVerdict, episode: Option<&str>) -> Vec<String> {
        let mut lines = vec![format!("{}: {}", level.title(), level.outcome.name())];
        lines.extend(level.testers.iter().map(|tester| format!("  {}", of_tester(tester))));
        lines.extend(level.stop.iter().map(|stop| format!("  {stop}")));
        for finding in level.findings.iter().take(MOST_FINDINGS) {
            lines.push(format!("  {}", of_finding(finding)));
            lines.extend(finding.file.iter().map(|file| self.replay(file)));
        }
        let more = level.findings.len().saturating_sub(MOST_FINDINGS);
        lines.extend((more > 0).then(|| format!("  and {}", counted(more as u64, "more finding"))));
        if let Some(file) = episode {
            lines.extend(["  an episode that failed:".to_owned(), self.replay(file)]);
        }
        let again = self.commands.again(level);
        if !again.is_empty() {
            lines.push("  the level again:".to_owned());
            lines.extend(again.into_iter().map(|command| format!("    {command}")));
        }
        lines
    }

    fn replay(&self, file: &str) -> String {
        format!("    {}", self.commands.replay(&self.folder.join(file)))
    }
}

fn of_tester(TesterVerdict { tester, score, .. }: &TesterVerdict) -> String {
    let mut words = format!("{tester}: solved {} of {}", score.solved, score.episodes);
    for (count, what) in [(score.lost, "lost"), (score.timed_out, "out of time"), (score.broken, "broken")] {
        if count > 0 {
            words += &format!(", {count} {what}");
        }
    }
    words
}

fn of_finding(finding: &Finding) -> String {
    let place = [
        finding.tester.clone(),
        finding.episode.map(|episode| format!("episode {episode}")),
        finding.tick.map(|tick| format!("tick {tick}")),
    ];
    let place: Vec<String> = place.into_iter().flatten().collect();
    let place = if place.is_empty() { String::new() } else { format!(" ({})", place.join(", ")) };
    format!("{}{place}: {}", finding.detector, finding.message)
}

/// Commands of a program.
pub(super) struct Commands<'a> {
    /// The command that starts the program.
    pub program: &'a str,
    /// The test, without testers that the program does not know.
    pub record: TestRecord,
    /// Name and path of each policy.
    pub policies: Vec<(String, String)>,
}

impl Commands<'_> {
    /// Returns the commands that play the same episodes of a level again.
    pub fn again(&self, level: &LevelVerdict) -> Vec<String> {
        let mut commands = rerun_commands(self.program, &self.record, level);
        // Findings are named with their own files, and all commands run in the same folder.
        commands
            .retain(|command| !command.starts_with(&format!("{} replay ", self.program)) && !command.starts_with('#'));
        for command in &mut commands {
            for (name, path) in &self.policies {
                *command = command.replace(&format!("--policy {name} "), &format!("--policy {} ", shell_word(path)));
            }
        }
        commands
    }

    /// Returns the command that replays a finding.
    pub fn replay(&self, file: &Path) -> String {
        replay(self.program, file)
    }
}

/// Returns the command that replays a finding.
pub(super) fn replay(program: &str, file: &Path) -> String {
    format!("{program} replay {}", shell_word(&file.display().to_string()))
}

// The testers by their names, and the reasons why levels cannot be tested.

/// A tester by its name.
#[derive(Clone)]
#[allow(clippy::large_enum_variant, reason = "a few per test")]
pub(super) enum Named {
    /// A bot of the game.
    Bot(String),
    /// A policy file.
    Policy { path: PathBuf, draw: ActionDraw },
    /// A player that the command line does not know.
    Player { name: String, player: Player },
}

impl Named {
    /// Prepares the tester for the game.
    pub fn tester(&self, game: &dyn Game) -> Result<Tester, LevelTestError> {
        match self {
            Self::Bot(name) => Ok(of_player(name, Player::bot(game, name)?)),
            Self::Policy { path, draw } => policy(game, path, *draw),
            Self::Player { name, player } => Ok(of_player(name, player.clone())),
        }
    }

    /// Returns the tester's name, if the command line does not know it.
    pub fn own_name(&self) -> Option<&str> {
        match self {
            Self::Player { name, .. } => Some(name),
            Self::Bot(_) | Self::Policy { .. } => None,
        }
    }
}

/// Returns a tester with vectors as observations.
pub(super) fn of_player(name: &str, player: Player) -> Tester {
    Tester { record: TesterRecord::bot(name), player, observation_config: ObservationConfig::default() }
}

fn policy(game: &dyn Game, path: &Path, draw: ActionDraw) -> Result<Tester, LevelTestError> {
    let file = PolicyFile::load(path, DeviceKind::default())?;
    check_policy(&game.metadata(), &file)
        .map_err(|misfit| LevelTestError::Misfit { path: path.into(), misfit: Box::new(misfit) })?;
    let observation_config = policy_observation(&file)?;
    observation_config.check(game)?;
    let greedy = matches!(draw, ActionDraw::Greedy);
    Ok(Tester {
        record: TesterRecord { greedy, ..TesterRecord::policy(None, path, file_checksum(path)?) },
        player: Player::of_file(&file, draw),
        observation_config,
    })
}

/// The reason why levels cannot be tested.
#[derive(Debug, Error)]
pub enum LevelTestError {
    /// No levels were named.
    #[error("no levels are named: write `.levels(\"MODE:first..last\")`, such as `.levels(\"default:0..9\")`")]
    NoLevels,
    /// The text names no levels.
    #[error(transparent)]
    Levels(#[from] SplitError),
    /// The game has no such mode, or a level file does not fit the game.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// The game has no such bot.
    #[error(transparent)]
    Bot(#[from] UnknownName),
    /// The game has no bot at all.
    #[error("`{0}` has no bot: name a policy with `LevelTest::policy`, or a player with `LevelTest::player`")]
    NoBot(&'static str),
    /// The policy cannot be read.
    #[error(transparent)]
    Policy(#[from] FileError),
    /// The policy's file cannot be read again.
    #[error(transparent)]
    Checksum(#[from] SealedFileError),
    /// The policy was made for another game, or another state of it.
    #[error("{}: {misfit}", path.display())]
    Misfit {
        /// Its file.
        path: PathBuf,
        /// The difference between policy and game.
        misfit: Box<PolicyMisfit>,
    },
    /// The policy does not name its observation.
    #[error(transparent)]
    Observation(#[from] UnknownObservation),
    /// The game cannot draw the picture that the policy needs.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// There is no such detector or setting.
    #[error(transparent)]
    Detector(#[from] DetectorError),
    /// The game cannot be played, or the plan is invalid.
    #[error(transparent)]
    Test(#[from] TestError),
    /// A finding cannot be written.
    #[error(transparent)]
    Finding(#[from] FindingError),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_words_of_a_shell() {
        assert_eq!(replay("jump", "a/b-1.finding".as_ref()), "jump replay a/b-1.finding");
        assert_eq!(replay("jump", "my levels/it's".as_ref()), r"jump replay 'my levels/it'\''s'");
    }
}
