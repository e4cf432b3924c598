//! The score of testers: how well they find planted defects.
//!
//! A [`ScorePlan`] runs [`Contestant`]s on all mutants and unmutated levels of a [`BugSet`], at
//! equal budgets and under the detectors of a test. A [`ScoreRun`] does so on all cores, and a [`ScoreJournal`] keeps
//! the finished jobs. A [`Score`] is the result. A [`ScoreTable`] joins several: recall and precision by class and
//! tester, the cost of a defect, and the testers that find most together.
//!
//! The folder, in reading order:
//!
//! - `record`: the record of a score: set, games, testers and settings; and the journal of finished jobs, beside the file
//!   of the score.
//! - `contestant`: the testers that are scored, the clocks for their jobs, and the detectors that they share.
//! - `playing`: the jobs: testers that play, and testers that explore.
//! - `found`: the rules that decide which defects were found.
//! - `table` and `mix`: the table that joins several scores, and the mixes of testers that find most together.
//! - `error`: errors of scoring testers.

mod contestant;
mod error;
mod found;
mod mix;
mod playing;
mod record;
#[cfg(test)]
mod run_tests;
mod table;
#[cfg(test)]
pub(crate) mod testing;

use crate::{
    bugs::{BugSet, Mutant, PlantedPart, defect_kinds},
    score::{
        contestant::{JobClock, JobDetectors, KnownSubject},
        error::io_error,
        found::Trial,
        playing::{play, search},
    },
};
use bevy_playbot::{
    engine::panics::hear,
    episode::{EpisodeEnd, EpisodeResult},
    state_hash::StateHash,
};
use playbot_harness::{defect::DefectKind, game::Game, split::LevelSplit};
use playbot_learner::{Workers, seal_json, unseal_json, write_atomically};
use playbot_test::{
    detectors::{Detectors, own_detectors},
    findings::{Breakage, Lengths},
};
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeSet,
    fs, io,
    path::Path,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread,
    thread::Builder,
};

pub use crate::score::{
    contestant::{ClockKind, Contestant, ContestantRecord, EXPLORE, EXPLORE_SKILLS, HOLD, Means, RANDOM},
    error::ScoreError,
    found::{FAR, FEWEST_SOUND, Found, RELIABLE, ScoredJob, judge},
    record::{GameRecord, SCORE_FORMAT, ScoreBudget, ScoreJournal, ScoreRecord, SetRecord, Subject, SubjectKind},
    table::{ClassRow, FEW_FALSE, ScoreTable, Share, TesterRow},
};

/// The results of testers on a set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// The set, the testers and the settings.
    #[serde(flatten)]
    pub record: ScoreRecord,
    /// The command that made it.
    pub command: String,
    /// The mutants and unmutated levels.
    pub subjects: Vec<Subject>,
    /// The results, in the order of the subjects and, for each, of the testers.
    pub jobs: Vec<ScoredJob>,
}

impl Score {
    /// Writes the file atomically, with a line for each subject and each job.
    ///
    /// # Errors
    ///
    /// The system cannot write.
    pub fn write(&self, path: &Path) -> Result<(), ScoreError> {
        let written = self.text().and_then(|text| write_atomically(path, seal_json(&text).as_bytes()));
        written.map_err(io_error("write", path))
    }

    fn text(&self) -> io::Result<String> {
        let head = serde_json::to_string(&self.record)?;
        let head = head.strip_suffix('}').unwrap_or(&head);
        let (subjects, jobs) = (lines(&self.subjects)?, lines(&self.jobs)?);
        let command = serde_json::to_string(&self.command)?;
        Ok(format!("{head},\"command\":{command},\n\"subjects\":[{subjects}],\n\"jobs\":[{jobs}]}}\n"))
    }

    /// Reads a file.
    ///
    /// # Errors
    ///
    /// The file is not a score, has a form that this program does not know, or cannot be read.
    pub fn read(path: &Path) -> Result<Self, ScoreError> {
        let text = fs::read_to_string(path).map_err(io_error("read", path))?;
        let no_score = |why: String| ScoreError::NoScore { path: path.into(), why };
        let of_json = |error: serde_json::Error| no_score(format!("line {}: {error}", error.line()));
        let text = unseal_json(&text).map_err(|error| no_score(error.to_string()))?.text;
        let FormOnly { format } = serde_json::from_str(&text).map_err(of_json)?;
        if format != SCORE_FORMAT {
            return Err(no_score(format!("a score in form {format}, but this program reads form {SCORE_FORMAT}")));
        }
        serde_json::from_str(&text).map_err(of_json)
    }
}

/// The part of the file that is read before its form is known.
#[derive(Deserialize)]
struct FormOnly {
    format: u32,
}

/// Returns the JSON of some items, a line each.
fn lines(items: &[impl Serialize]) -> serde_json::Result<String> {
    let mut text = String::new();
    for (index, item) in items.iter().enumerate() {
        text.push_str(if index == 0 { "\n" } else { ",\n" });
        text.push_str(&serde_json::to_string(item)?);
    }
    Ok(text)
}

// The plan of a score.

/// The plan of a score: sets, games, testers, budget.
#[derive(Clone)]
pub struct ScorePlan<'a> {
    /// The mutants and unmutated levels.
    pub set: &'a BugSet,
    /// Folder of the set.
    pub folder: &'a Path,
    /// The games that are tested; others of the set are left out.
    pub games: Vec<TestedGame<'a>>,
    /// The budget of each tester on each of them.
    pub budget: ScoreBudget,
    /// The clock.
    pub clock: ClockKind,
    /// Threads. They change no result but the times.
    pub threads: usize,
}

/// A game, and its testers.
#[derive(Clone)]
pub struct TestedGame<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// The testers, with different names.
    pub contestants: Vec<Contestant>,
    /// The detectors.
    pub detectors: Detectors,
}

impl ScorePlan<'_> {
    /// Checks that there is something to test, and that testers have different names.
    ///
    /// # Errors
    ///
    /// [`ScoreError::NoMutant`], [`ScoreError::NoTester`], [`ScoreError::SameName`], or the set does not fit this
    /// program.
    pub fn check(&self) -> Result<(), ScoreError> {
        let is_tested = |name: &str| self.games.iter().any(|tested| tested.game.name() == name);
        if !self.set.mutants.iter().any(|bug| is_tested(&bug.game)) {
            let names: Vec<&str> = self.games.iter().map(|tested| tested.game.name()).collect();
            return Err(ScoreError::NoMutant(names.join(", ")));
        }
        for TestedGame { game, contestants, .. } in &self.games {
            self.set.check(self.folder, *game)?;
            if contestants.is_empty() {
                return Err(ScoreError::NoTester(game.name().to_owned()));
            }
            for (index, contestant) in contestants.iter().enumerate() {
                let name = &contestant.record.name;
                if contestants[..index].iter().any(|other| other.record.name == *name) {
                    return Err(ScoreError::SameName { game: game.name().to_owned(), tester: name.clone() });
                }
            }
        }
        Ok(())
    }

    /// Returns the record of the plan that files store.
    pub fn record(&self) -> ScoreRecord {
        let game = |tested: &TestedGame| GameRecord {
            name: tested.game.name().to_owned(),
            version: tested.game.version(),
            testers: tested.contestants.iter().map(|contestant| contestant.record.clone()).collect(),
            detectors: tested.detectors.record().to_vec(),
            own_detectors: own_detectors(tested.game),
        };
        ScoreRecord {
            format: SCORE_FORMAT,
            set: SetRecord { seed: self.set.seed, hash: hash_of(self.set) },
            games: self.games.iter().map(game).collect(),
            budget: self.budget,
            clock: self.clock,
        }
    }
}

/// Returns a hash of all mutants and unmutated levels.
fn hash_of(set: &BugSet) -> String {
    let BugSet { seed, games, mutants, sound } = set;
    let text = serde_json::to_string(&(seed, games, mutants, sound)).unwrap_or_default();
    format!("{:016x}", StateHash::of(text.bytes().map(u64::from)).0)
}

/// The result of a tester on a subject.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JobResult {
    /// The subject.
    pub subject: String,
    /// The tester.
    pub tester: String,
    /// Episodes in which the goal was reached; for an explorer, 1 if it found a path to it.
    pub solved: u64,
    /// All episodes; 1 for an explorer.
    pub episodes: u64,
    /// True if the tester used no random number.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub exact: bool,
    /// The end of each episode and its tick: `won 83`, `lost 12`, `time up 1000` or `broken`.
    pub ends: Vec<String>,
    /// Mean total reward of the episodes. `None` for explorers, and if a reward is not a number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reward: Option<f64>,
    /// Findings of the detectors, and panics of the game.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<JobFinding>,
    /// The reason that the level is unsolvable, if that was proved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unsolvable: Option<String>,
    /// Actions with an effect in the whole episode of the first finding that can be replayed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub played: Option<u32>,
    /// Actions with an effect up to the tick of the finding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub original: Option<u32>,
    /// Actions that are left after minimisation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minimised: Option<u32>,
    /// Seconds that the job took, without minimisation.
    pub seconds: f64,
    /// Seconds until the first finding or the proof.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub found_after: Option<f64>,
    /// Seconds until the end of the first episode that did not reach the goal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed_after: Option<f64>,
}

/// A finding of a tester.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobFinding {
    /// Name of the detector.
    pub detector: String,
    /// Tick of the episode, if it is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tick: Option<u32>,
    /// The message.
    pub message: String,
}

impl JobResult {
    /// Returns whether the goal was reached in every episode.
    pub fn is_solved(&self) -> bool {
        self.episodes > 0 && self.solved == self.episodes
    }

    /// Creates the result of a game that panicked before the first tick, or outside of its ticks.
    fn broken(broken: Breakage, seconds: f64) -> Self {
        let Breakage { detector, tick: _, message } = broken;
        Self {
            episodes: 1,
            ends: vec![end_of(None)],
            findings: vec![JobFinding { detector: detector.to_owned(), tick: None, message }],
            seconds,
            found_after: Some(seconds),
            failed_after: Some(seconds),
            ..Self::default()
        }
    }

    /// Adds the lengths of a minimised finding.
    #[must_use]
    fn with_lengths(self, lengths: Option<Lengths>) -> Self {
        let of = |length: fn(Lengths) -> u32| lengths.map(length);
        let (played, original) = (of(|lengths| lengths.played), of(|lengths| lengths.original));
        Self { played, original, minimised: of(|lengths| lengths.minimised), ..self }
    }

    /// Returns the result without its times.
    #[must_use]
    pub fn without_times(&self) -> Self {
        Self { seconds: 0.0, found_after: None, failed_after: None, ..self.clone() }
    }
}

/// Returns the mean total reward of episodes; `None` if there are no episodes, one broke, or a reward is not a number.
fn mean_reward(ends: &[Option<EpisodeResult>]) -> Option<f64> {
    let rewards: Option<Vec<f64>> = ends.iter().map(|end| end.as_ref().map(|end| end.total_reward)).collect();
    let mean = rewards.map(|rewards| rewards.iter().sum::<f64>() / rewards.len() as f64);
    mean.filter(|mean| mean.is_finite())
}

/// Returns the end of an episode in words.
fn end_of(result: Option<&EpisodeResult>) -> String {
    let Some(result) = result else { return "broken".to_owned() };
    let how = match result.end {
        _ if result.success => "won",
        EpisodeEnd::Truncated => "time up",
        EpisodeEnd::Terminated { .. } => "lost",
    };
    format!("{how} {}", result.ticks)
}

// The run of all testers on all subjects, on all cores.

/// The callbacks of a running score.
pub struct ScoreCallbacks<'a> {
    /// Receives how many more jobs have finished; called from several threads.
    pub progress: &'a (dyn Fn(u64) + Sync),
    /// Returns true to stop; finished jobs are kept.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// A score in progress.
pub struct ScoreRun<'a> {
    plan: &'a ScorePlan<'a>,
    cases: Vec<Case>,
}

/// A job that the journal does not have.
struct OpenJob<'a> {
    case: &'a Case,
    contestant: &'a Contestant,
    /// What its subject's jobs share.
    known: Arc<KnownSubject>,
}

/// The state that the threads share.
struct Shared<'a> {
    next: usize,
    journal: &'a mut ScoreJournal,
    failure: Option<ScoreError>,
    is_stopped: bool,
}

impl Shared<'_> {
    /// Returns whether no further job is run.
    fn is_over(&self) -> bool {
        self.failure.is_some() || self.is_stopped
    }
}

impl<'a> ScoreRun<'a> {
    /// Checks the plan, and reads all levels.
    ///
    /// # Errors
    ///
    /// The plan tests nothing, or something in the set cannot be played.
    pub fn new(plan: &'a ScorePlan<'a>) -> Result<Self, ScoreError> {
        plan.check()?;
        Ok(Self { plan, cases: cases(plan)? })
    }

    /// Returns the number of jobs: each tester on each subject of its game.
    pub fn jobs(&self) -> u64 {
        self.cases.iter().map(|case| self.plan.games[case.game].contestants.len() as u64).sum()
    }

    /// Runs all jobs that the journal does not have, and judges all of them; `None` if `stop` returned true.
    ///
    /// The results, apart from the times, depend on the plan's budget, the tester and the subject alone. A mutant that
    /// makes a tester panic is a finding.
    ///
    /// # Errors
    ///
    /// A tester cannot play at all, or the journal cannot be written.
    pub fn run(&self, journal: &mut ScoreJournal, watch: &ScoreCallbacks) -> Result<Option<Score>, ScoreError> {
        let mut open: Vec<OpenJob> = Vec::new();
        for case in &self.cases {
            let tested = &self.plan.games[case.game];
            let known = Arc::new(KnownSubject::new(&tested.detectors));
            let is_open = |contestant: &&Contestant| {
                let key = (case.subject.id.clone(), contestant.record.name.clone());
                !journal.finished().contains_key(&key)
            };
            let jobs = tested.contestants.iter().filter(is_open);
            open.extend(jobs.map(|contestant| OpenJob { case, contestant, known: Arc::clone(&known) }));
        }
        let threads = self.plan.threads.clamp(1, open.len().max(1));
        let shared = Mutex::new(Shared { next: 0, journal: &mut *journal, failure: None, is_stopped: false });
        // Networks take no other threads.
        let workers = || Workers::new(self.plan.threads / threads);
        let run = || workers().bound(|| self.work(&open, &shared, watch));
        thread::scope(|scope| {
            for _ in 1..threads {
                // With fewer threads than asked for, the score only takes longer.
                let _ = Builder::new().spawn_scoped(scope, run);
            }
            run();
        });
        let Shared { failure, is_stopped, .. } = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
        match failure {
            Some(error) => return Err(error),
            None if is_stopped => return Ok(None),
            None => {}
        }
        let result = |(case, contestant): (&Case, &Contestant)| {
            journal.finished().get(&(case.subject.id.clone(), contestant.record.name.clone())).cloned()
        };
        let results: Vec<JobResult> = self.all().filter_map(result).collect();
        let subjects: Vec<_> = self.cases.iter().map(|case| case.subject.clone()).collect();
        let jobs = judge(&subjects, results);
        Ok(Some(Score { record: self.plan.record(), command: journal.command().to_owned(), subjects, jobs }))
    }

    /// Returns all jobs in the order of the score.
    fn all(&self) -> impl Iterator<Item = (&Case, &Contestant)> {
        self.cases.iter().flat_map(move |case| {
            self.plan.games[case.game].contestants.iter().map(move |contestant| (case, contestant))
        })
    }

    /// Runs open jobs, one after the other, on one thread.
    fn work(&self, open: &[OpenJob], shared: &Mutex<Shared>, watch: &ScoreCallbacks) {
        loop {
            let next = {
                let mut shared = lock(shared);
                if shared.is_over() {
                    return;
                }
                shared.next += 1;
                shared.next - 1
            };
            let Some(open) = open.get(next) else { return };
            let done = self.job(open, watch);
            let mut shared = lock(shared);
            let kept = match done {
                Ok(Some(result)) => shared.journal.push(result).map(|()| (watch.progress)(1)),
                Ok(None) => {
                    shared.is_stopped = true;
                    Ok(())
                }
                Err(error) => Err(error),
            };
            if let Err(error) = kept {
                shared.failure.get_or_insert(error);
            }
        }
    }

    fn job(&self, open: &OpenJob, watch: &ScoreCallbacks) -> Result<Option<JobResult>, ScoreError> {
        if (watch.stop)() {
            return Ok(None);
        }
        let OpenJob { case, contestant, known } = open;
        let tested = &self.plan.games[case.game];
        let detectors = JobDetectors::new(&tested.detectors, self.plan.clock, known);
        let mutant = case.mutant(tested.game);
        let clock = JobClock::start(self.plan.clock, &detectors.charges);
        let trial = Trial {
            game: &mutant,
            mode: &case.mode,
            level: case.level,
            name: &case.name,
            contestant,
            detectors: &detectors.detectors,
            budget: self.plan.budget,
            shortens: case.subject.class().is_some(),
            clock,
            stop: watch.stop,
        };
        let done = hear(|| match &contestant.means {
            Means::Plays(player) => play(&trial, player),
            Means::Explores(explorer) => search(&trial, explorer),
        });
        let result = done.unwrap_or_else(|message| {
            let broken = Breakage { detector: "panic", tick: 0, message };
            Ok(Some(JobResult::broken(broken, trial.clock.seconds())))
        })?;
        let (subject, tester) = (case.subject.id.clone(), contestant.record.name.clone());
        Ok(result.map(|result| JobResult { subject, tester, ..result }))
    }
}

fn lock<'a, 'b>(shared: &'a Mutex<Shared<'b>>) -> MutexGuard<'a, Shared<'b>> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

// Subjects, ready to be played.

/// A subject, and its levels and rules.
struct Case {
    pub subject: Subject,
    /// Index of the game in the plan.
    pub game: usize,
    pub mode: String,
    pub level: u64,
    /// Name of the unmutated level. Seeds are derived from it.
    pub name: String,
    /// The defect in the rules and its variant, if there is one.
    rules: Option<(DefectKind, u32)>,
}

impl Case {
    /// Returns the game that is played.
    pub fn mutant<'a>(&self, game: &'a dyn Game) -> Mutant<&'a dyn Game> {
        match &self.rules {
            Some((kind, variant)) => Mutant::new(game, kind, *variant),
            None => Mutant::sound(game),
        }
    }

    fn sound(game: usize, name: &str, kind: SubjectKind, mode: &str, level: u64) -> Self {
        let id = Subject::id_of_level(name, mode, level);
        Self {
            subject: Subject { id, game: name.to_owned(), kind },
            game,
            mode: mode.to_owned(),
            level,
            name: format!("{mode}:{level}"),
            rules: None,
        }
    }
}

/// Returns all subjects of the plan's games: for each game the mutants, the levels that they were made of, and the
/// unmutated levels.
///
/// # Errors
///
/// A level cannot be played, or a defect is unknown.
fn cases(plan: &ScorePlan) -> Result<Vec<Case>, ScoreError> {
    let mut cases = Vec::new();
    for (index, tested) in plan.games.iter().enumerate() {
        let own = cases_of(plan, index, tested)?;
        for case in &own {
            let split = LevelSplit { mode: case.mode.clone(), first: case.level, last: case.level };
            let subject = || case.subject.id.clone();
            split.check(tested.game).map_err(|source| ScoreError::Level { subject: subject(), source })?;
        }
        cases.extend(own);
    }
    Ok(cases)
}

fn cases_of(plan: &ScorePlan, index: usize, tested: &TestedGame) -> Result<Vec<Case>, ScoreError> {
    let (name, kinds) = (tested.game.name(), defect_kinds(tested.game));
    let sound_levels = plan.set.sound.iter().filter(|sound| sound.game == name);
    let sound_levels =
        sound_levels.flat_map(|sound| sound.range.levels().map(|level| (sound.range.mode.clone(), level)));
    let sound_levels: BTreeSet<(String, u64)> = sound_levels.collect();
    let (mut cases, mut originals) = (Vec::new(), BTreeSet::new());
    for bug in plan.set.mutants.iter().filter(|bug| bug.game == name) {
        let rules = match bug.planted {
            PlantedPart::Level(_) => None,
            PlantedPart::Rules { variant } => {
                let kind = kinds.iter().find(|kind| kind.class == bug.class);
                let unknown = || ScoreError::Unknown { subject: bug.id.clone(), class: bug.class.clone() };
                Some((kind.ok_or_else(unknown)?.clone(), variant))
            }
        };
        let original = (bug.mode.clone(), bug.level);
        let id = Subject::id_of_level(name, &bug.mode, bug.level);
        let kind = SubjectKind::Mutant { class: bug.class.clone(), original: id };
        let (mode, level) = bug.played(plan.folder);
        let subject = Subject { id: bug.id.clone(), game: name.to_owned(), kind };
        cases.push(Case { subject, game: index, mode, level, name: bug.base(), rules });
        if !sound_levels.contains(&original) {
            originals.insert(original);
        }
    }
    let of =
        |kind: SubjectKind| move |(mode, level): &(String, u64)| Case::sound(index, name, kind.clone(), mode, *level);
    cases.extend(originals.iter().map(of(SubjectKind::Original)));
    cases.extend(sound_levels.iter().map(of(SubjectKind::Sound)));
    Ok(cases)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::testing::{job, mutant, record};

    #[test]
    fn ends_are_distinguished() {
        let result =
            EpisodeResult { level: 3, end: EpisodeEnd::LOST, success: false, ticks: 9, clipped: 0, total_reward: 0.0 };
        let late = EpisodeResult { end: EpisodeEnd::Truncated, ..result };
        let won = EpisodeResult { end: EpisodeEnd::Truncated, success: true, ..result };
        let ends = [Some(&result), Some(&late), Some(&won), None].map(end_of);
        assert_eq!(ends, ["lost 9", "time up 9", "won 9", "broken"]);
    }

    #[test]
    fn a_mean_needs_a_number_of_each_episode() {
        let of = |total_reward| {
            let (end, success) = (EpisodeEnd::LOST, false);
            Some(EpisodeResult { level: 3, end, success, ticks: 9, clipped: 0, total_reward })
        };
        assert_eq!(mean_reward(&[of(3.0), of(-1.0)]), Some(1.0));
        for ends in [vec![], vec![of(3.0), None], vec![of(3.0), of(f64::NAN)], vec![of(f64::INFINITY)]] {
            assert_eq!(mean_reward(&ends), None, "{ends:?}");
        }
    }

    #[test]
    fn a_short_result_has_a_short_line() {
        let result = JobResult {
            subject: "garden bed:3".to_owned(),
            tester: "random".to_owned(),
            solved: 1,
            episodes: 1,
            ends: vec!["won 9".to_owned()],
            seconds: 0.5,
            ..JobResult::default()
        };
        let text = serde_json::to_string(&result).expect("serialises");
        let expected =
            r#"{"subject":"garden bed:3","tester":"random","solved":1,"episodes":1,"ends":["won 9"],"seconds":0.5}"#;
        assert_eq!(text, expected);
        assert_eq!(serde_json::from_str::<JobResult>(&text).expect("reads back"), result);
        assert!(result.is_solved() && !JobResult::default().is_solved());
    }

    #[test]
    fn a_score_is_written_in_lines_and_reads_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("score.json");
        let score = Score {
            record: record("garden", &["random"]),
            command: "playbot bugs score set --out \"a b.json\"".to_owned(),
            subjects: vec![mutant("garden", "a", "panic"), mutant("garden", "b", "panic")],
            jobs: vec![job("a", "random", true), job("b", "random", false)],
        };
        score.write(&path).expect("writable");
        assert_eq!(Score::read(&path).expect("readable"), score);
        assert_eq!(fs::read_to_string(&path).expect("readable").lines().count(), 7);
        let empty = Score { subjects: Vec::new(), jobs: Vec::new(), ..score };
        empty.write(&path).expect("writable");
        assert_eq!(Score::read(&path).expect("readable"), empty);
    }

    #[test]
    fn what_is_no_score_is_refused_with_what_is_wrong() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("score.json");
        let said = |text: &str| {
            fs::write(&path, text).expect("writable");
            Score::read(&path).expect_err("no score").to_string()
        };
        let none = Score::read(&folder.path().join("none.json")).expect_err("no file").to_string();
        assert!(none.contains("none.json") && none.contains("name an existing file"), "{none}");
        assert!(said("{").contains("score.json: line 1: "));
        assert!(said("{\"format\":1}").contains("missing field"));
        assert!(said("{\"format\":9}").contains("a score in form 9, but this program reads form 1"));
    }
}
