//! Lessons: from a recording to a policy that plays as soon as possible, and then better and better.
//!
//! Behaviour cloning gives the first policy after seconds. SCORE-PPO on copies of the game goes on from it, and each
//! policy that returns at least as much as the best one so far replaces it, at the same path. So a game that shows the
//! policy shows it getting better.
//!
//! Files of a folder of lessons:
//!
//! - `learned.policy`: the best policy of all lessons on the levels of the last one.
//! - `NAME/learned.policy`: the best policy of one lesson. Its name changes with the recordings and with the settings.
//! - `NAME/imitation.json`: the mean return of imitation, which a better policy has to reach.
//! - `NAME/skills.safetensors` and `NAME/run/`: what it imitated, and its training, from which it goes on.
//!
//! ```no_run
//! use playbot_harness::game::Game;
//! use playbot_learner::DeviceKind;
//! use playbot_train::{
//!     Experiment,
//!     lesson::{LessonPlan, teach},
//!     run_observer::Unobserved,
//!     train_run::TrainingSetup,
//! };
//! # fn lesson(game: &dyn Game, experiment: &Experiment) -> Result<(), Box<dyn std::error::Error>> {
//! let setup = TrainingSetup::new(DeviceKind::default(), 2);
//! let plan = LessonPlan { game, experiment, recordings: "ada.demo".as_ref(), folder: "lessons".as_ref(), setup: &setup };
//! let is_done = teach(&plan, &mut Unobserved, &mut |learned| println!("{} plays", learned.file.display()))?;
//! # Ok(())
//! # }
//! ```

use crate::{
    Algorithm, Experiment,
    experiment::CheckpointConfig,
    learn_skills::behaviour_cloning_skills,
    metrics_log::{EPISODES, EPISODIC_RETURN, JsonLines, MetricsLog, is_settled},
    pipeline,
    pipeline::PipelineError,
    policy_export::{ExportError, Provenance, export_policy, policy_file},
    run_dir::RunDir,
    run_observer::{CountedWork, RunEvent, RunObserver},
    train_run::{TrainingError, TrainingSetup},
};
use bevy_playbot::{
    demo::file::{DemoFileError, find_demos},
    lesson::LessonStage,
    policy::ActionDraw,
};
use playbot_harness::{
    eval::{EvalPlan, Player, evaluate, summarize},
    game::Game,
    sealed_file::{SealedFileError, file_checksum, io_error, read_sealed, write_atomically, write_sealed},
    split::LevelSplit,
};
use playbot_learner::{HasExitCode, PolicyFile, SkillModel, disk};
use serde::{Deserialize, Serialize};
use std::{
    fs,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// Name of the policy in the folder of all lessons, and in that of each.
pub const LEARNED: &str = "learned.policy";

/// Settings of a lesson for a game that has no experiment of its own, as `key=value`: a first policy within seconds, and
/// training that does not unlearn what was shown.
pub const SETTINGS: [&str; 10] = [
    "algorithm=score-ppo",
    "steps=2000000",
    "arenas=16",
    "skills.epochs=60",
    "skills.batch=64",
    "skills.action_noise=0.1",
    "score.kl_coef=0.1",
    "ppo.lr=0.0003",
    "ppo.ent_coef=0.003",
    "ppo.gamma=0.99",
];

/// The setting of a game whose observation is numbers.
pub const OF_NUMBERS: &str = "skills.norm_obs=true";

/// A lesson: what is learned, from what and into which folder.
#[derive(Clone, Copy)]
pub struct LessonPlan<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Settings; the algorithm must be SCORE-PPO.
    pub experiment: &'a Experiment,
    /// A recording, or a folder of them.
    pub recordings: &'a Path,
    /// Folder of all lessons of this game. Each state of the recordings and of the settings has a folder of its own in it,
    /// in which a later call goes on.
    pub folder: &'a Path,
    /// Circumstances of the training.
    pub setup: &'a TrainingSetup<'a>,
}

/// A policy that was learned.
#[derive(Clone, Copy, Debug)]
pub struct Learned<'a> {
    /// The file of this lesson's best policy.
    pub file: &'a Path,
    /// True if it is also that of the folder of all lessons; false if an earlier lesson's returned more on these levels.
    pub is_best: bool,
    /// Imitation or training.
    pub stage: LessonStage,
    /// Environment steps of training.
    pub steps: u64,
    /// Mean return of the last 100 episodes of training; `None` before one has ended.
    pub mean_return: Option<f64>,
}

/// Failure of a lesson.
#[derive(Debug, Error)]
pub enum LessonError {
    /// Another algorithm was asked for.
    #[error("a lesson imitates first and then trains by score-ppo, not by {0}: leave `algorithm` out")]
    Algorithm(Algorithm),
    /// The recordings cannot be found.
    #[error(transparent)]
    Demo(#[from] DemoFileError),
    /// A file or folder cannot be read or made.
    #[error(transparent)]
    File(#[from] SealedFileError),
    /// Imitation or training failed.
    #[error(transparent)]
    Pipeline(Box<PipelineError>),
    /// The policy cannot be written.
    #[error(transparent)]
    Export(#[from] ExportError),
}

impl From<PipelineError> for LessonError {
    fn from(error: PipelineError) -> Self {
        Self::Pipeline(error.into())
    }
}

impl From<TrainingError> for LessonError {
    fn from(error: TrainingError) -> Self {
        PipelineError::from(error).into()
    }
}

impl HasExitCode for LessonError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Algorithm(_) => 3,
            Self::Demo(error) => error.exit_code(),
            Self::File(error) => error.exit_code(),
            Self::Pipeline(error) => error.exit_code(),
            Self::Export(error) => error.exit_code(),
        }
    }
}

/// Learns from recordings until the experiment's steps are done or the observer stops it, and calls `learned` for each
/// policy that is written. Returns whether it was done.
///
/// The same call goes on where it was stopped. More recordings or other settings begin a lesson of their own, and the old
/// one stays.
///
/// # Errors
///
/// [`LessonError`]. What was written before stays.
pub fn teach(
    plan: &LessonPlan<'_>,
    observer: &mut dyn RunObserver,
    learned: &mut dyn FnMut(Learned<'_>),
) -> Result<bool, LessonError> {
    let algorithm = plan.experiment.algorithm;
    if algorithm != Algorithm::ScorePpo {
        return Err(LessonError::Algorithm(algorithm));
    }
    // A policy that was written is that of a checkpoint.
    let checkpoints = CheckpointConfig { every: 1, ..plan.experiment.checkpoints };
    let demos = Some(plan.recordings.to_owned());
    let experiment = Experiment { demos, checkpoints, ..plan.experiment.clone() };
    let own = plan.folder.join(name(plan.recordings, &experiment)?);
    disk::create_dir_all(&own).map_err(io_error("create", &own))?;
    let skill_file = own.join("skills.safetensors");
    let skills = match pipeline::learn_skills(plan.game, &experiment, &skill_file, plan.setup, observer) {
        Ok(skills) => skills,
        Err(PipelineError::Stopped(_)) => return Ok(false),
        Err(error) => return Err(error.into()),
    };
    let run = own.join(RUN);
    let with = Some((skill_file.as_path(), &skills));
    let mut training = pipeline::begin_or_resume(plan.game, &experiment, with, &run, plan.setup, observer)?;
    let files = Files { own: own.join(LEARNED), of_all: plan.folder.join(LEARNED), elsewhere: elsewhere(plan, &own) };
    let file = files.own.as_path();
    let begun = own.join(IMITATION);
    let best = if training.trainer.steps() == 0 {
        let policy = imitated(plan, &experiment, &skills, file)?;
        let stage = LessonStage::Imitation;
        // It plays at once, and is measured while it does.
        learned(Learned { file, is_best: files.publish(None)?, stage, steps: 0, mean_return: None });
        let mean_return = measured(plan, &experiment, &policy, observer)?;
        write_sealed(&begun, &Imitation { mean_return })?;
        Kept { stage, steps: 0, mean_return: Some(mean_return) }
    } else {
        Kept::of(&own)?
    };
    let Kept { stage, steps, mean_return } = best;
    if file.exists() {
        learned(Learned { file, is_best: files.publish(mean_return)?, stage, steps, mean_return });
    }
    let mut best = mean_return;
    training.drive_with(observer, &mut |trainer, report| {
        // The mean of a few episodes may be that of the shortest, and is no measure.
        let mean = report.episodic_return.filter(|_| report.is_settled());
        if !mean.is_some_and(|mean| replaces(mean, best)) {
            return Ok(());
        }
        best = mean;
        let policy = pipeline::policy(plan.game, trainer);
        export_policy(plan.game, &policy, &experiment.train, experiment.seed, file)?;
        let (stage, is_best) = (LessonStage::Training, files.publish(mean)?);
        learned(Learned { file, is_best, stage, steps: trainer.steps(), mean_return: mean });
        Ok(())
    })
}

/// Name of the folder of the training in that of a lesson.
const RUN: &str = "run";

/// Name of the file with the result of imitation.
const IMITATION: &str = "imitation.json";

/// Episodes in which imitation is measured.
const MEASURED: u32 = 32;

/// The result of imitation.
#[derive(Serialize, Deserialize)]
struct Imitation {
    mean_return: f64,
}

/// The files of the best policy.
struct Files {
    /// Of this lesson.
    own: PathBuf,
    /// Of all lessons.
    of_all: PathBuf,
    /// The highest mean return of all other lessons on the same levels.
    elsewhere: Option<f64>,
}

impl Files {
    /// Makes this lesson's policy that of all lessons, unless another one returned more. Returns whether it is.
    fn publish(&self, mean_return: Option<f64>) -> Result<bool, SealedFileError> {
        let Self { own, of_all, elsewhere } = self;
        let is_best = elsewhere.is_none_or(|other| mean_return.is_some_and(|mean| replaces(mean, Some(other))));
        if is_best || !of_all.exists() {
            let bytes = fs::read(own).map_err(io_error("read", own))?;
            write_atomically(of_all, &bytes)?;
        }
        Ok(is_best)
    }
}

/// Returns the highest mean return of all lessons on the same levels but the one in `own`. Lessons that cannot be read have
/// none.
fn elsewhere(plan: &LessonPlan<'_>, own: &Path) -> Option<f64> {
    let folders = fs::read_dir(plan.folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let others = folders.filter(|folder| folder != own && folder.join(LEARNED).exists());
    let same = others.filter(|folder| {
        RunDir::open(&folder.join(RUN)).is_ok_and(|opened| opened.experiment.train == plan.experiment.train)
    });
    same.filter_map(|folder| Kept::of(&folder).ok()?.mean_return).max_by(f64::total_cmp)
}

/// Returns whether a policy with a mean return replaces the best one so far.
fn replaces(mean: f64, best: Option<f64>) -> bool {
    best.is_none_or(|best| mean >= best)
}

/// The policy of a lesson that was kept.
#[derive(Debug, PartialEq)]
struct Kept {
    stage: LessonStage,
    steps: u64,
    mean_return: Option<f64>,
}

impl Kept {
    /// Finds it in the folder of a lesson: the last one that returned at least as much as all before it.
    fn of(lesson: &Path) -> Result<Self, SealedFileError> {
        let begun = lesson.join(IMITATION);
        // A lesson that was stopped before has none.
        let imitation = if begun.exists() { Some(read_sealed::<Imitation>(&begun)?.0.mean_return) } else { None };
        let mut kept = Self { stage: LessonStage::Imitation, steps: 0, mean_return: imitation };
        let log = MetricsLog::new(&lesson.join(RUN));
        let lines = JsonLines::read(log.metrics_file()).map_err(io_error("read", log.metrics_file()))?.lines;
        for line in lines.iter().filter(|line| is_settled(line.value[EPISODES].as_f64().unwrap_or(0.0) as u64)) {
            if let Some(mean) = line.value[EPISODIC_RETURN].as_f64().filter(|mean| replaces(*mean, kept.mean_return)) {
                kept = Self { stage: LessonStage::Training, steps: line.step, mean_return: Some(mean) };
            }
        }
        Ok(kept)
    }
}

/// Returns a name that changes with the recordings, and with the settings but for the number of steps.
fn name(recordings: &Path, experiment: &Experiment) -> Result<String, LessonError> {
    let files = find_demos(recordings)?;
    let sums = files.iter().map(|file| file_checksum(file)).collect::<Result<Vec<_>, _>>()?;
    let settings =
        Experiment { steps: 0, demos: None, checkpoints: CheckpointConfig::default(), ..experiment.without_study() };
    // An order of files is part of what is learned from.
    let [sums, settings] = [sums.join(" "), format!("{settings:?}")].map(|words| crc32fast::hash(words.as_bytes()));
    Ok(format!("{sums:08x}-{settings:08x}"))
}

/// Writes the policy of behaviour cloning, and returns it.
fn imitated(
    plan: &LessonPlan<'_>,
    experiment: &Experiment,
    skills: &SkillModel,
    file: &Path,
) -> Result<PolicyFile, LessonError> {
    let seen = skills.demos().cloned();
    let training = seen.as_ref().map_or_else(|| "recordings".to_owned(), |seen| format!("recordings of {seen}"));
    let code = format!("playbot {}", env!("CARGO_PKG_VERSION"));
    let provenance = Provenance { algorithm: "bc".to_owned(), training, seen, code };
    let cloned = behaviour_cloning_skills(skills, experiment);
    let policy = policy_file(plan.game, &experiment.observation_config(), skills.policy(), Some(cloned), provenance);
    export_policy(plan.game, &policy, &experiment.train, experiment.seed, file)?;
    Ok(policy)
}

/// Returns the mean return of a policy on the first levels of the training.
fn measured(
    plan: &LessonPlan<'_>,
    experiment: &Experiment,
    policy: &PolicyFile,
    observer: &mut dyn RunObserver,
) -> Result<f64, LessonError> {
    let train = &experiment.train;
    let last = train.last.min(train.first.saturating_add(u64::from(MEASURED) - 1));
    let split = LevelSplit { last, ..train.clone() };
    let episodes_per_level = MEASURED.div_ceil(split.len() as u32);
    let eval = EvalPlan { episodes_per_level, ..experiment.eval_plan(&split, plan.setup.threads) };
    let name = LessonStage::Imitation.to_string();
    let counter = observer.counter(CountedWork::Measure { name: &name, episodes: eval.episodes() });
    let player = Player::of_file(policy, ActionDraw::Sample);
    let played = evaluate(plan.game, &player, &eval, counter).map_err(PipelineError::from)?;
    let summary = summarize(&name, &split, &played);
    observer.observe(RunEvent::Measured(&summary));
    Ok(summary.return_mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics_log::append_json_line;
    use serde_json::json;

    #[test]
    fn the_best_policy_so_far_is_kept_but_for_means_of_few_episodes() {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        let now = || {
            let Kept { stage, steps, mean_return } = Kept::of(folder).expect("readable");
            (stage, steps, mean_return)
        };
        assert_eq!(now(), (LessonStage::Imitation, 0, None), "it was stopped early");
        write_sealed(&folder.join(IMITATION), &Imitation { mean_return: 4.0 }).expect("writable");
        fs::create_dir(folder.join(RUN)).expect("writable");
        let log = MetricsLog::new(&folder.join(RUN));
        let mut kept = Vec::new();
        for (step, episodes, mean) in [
            (1, 0, None),
            (2, 3, Some(9.0)),
            (3, 120, Some(2.0)),
            (4, 150, Some(5.0)),
            (5, 170, Some(4.0)),
            (6, 190, Some(5.0)),
        ] {
            let line = json!({ "step": step, EPISODES: episodes, EPISODIC_RETURN: mean });
            append_json_line(log.metrics_file(), &line).expect("writable");
            kept.push(now());
        }
        let (imitation, trained) =
            ((LessonStage::Imitation, 0, Some(4.0)), |step| (LessonStage::Training, step, Some(5.0)));
        assert_eq!(kept, [imitation, imitation, imitation, trained(4), trained(4), trained(6)]);
    }

    #[test]
    fn a_lesson_replaces_the_policy_of_all_lessons_if_it_returns_as_much() {
        let folder = tempfile::tempdir().expect("a folder");
        let (own, of_all) = (folder.path().join("own"), folder.path().join("of_all"));
        fs::write(&own, "new").expect("writable");
        let publish = |elsewhere: Option<f64>, mean_return: Option<f64>| {
            fs::write(&of_all, "old").expect("writable");
            let is_best = Files { own: own.clone(), of_all: of_all.clone(), elsewhere }.publish(mean_return);
            (is_best.expect("writable"), fs::read_to_string(&of_all).expect("it is there"))
        };
        assert_eq!(publish(Some(3.0), Some(2.0)), (false, "old".to_owned()));
        assert_eq!(publish(Some(3.0), None), (false, "old".to_owned()), "imitation is not measured");
        assert_eq!(publish(Some(3.0), Some(3.0)), (true, "new".to_owned()));
        assert_eq!(publish(None, None), (true, "new".to_owned()), "no other lesson is measured");
        fs::remove_file(&of_all).expect("it is there");
        let files = Files { own: own.clone(), of_all: of_all.clone(), elsewhere: Some(3.0) };
        assert_eq!((files.publish(None).expect("writable"), of_all.exists()), (false, true), "better than none");
    }
}
