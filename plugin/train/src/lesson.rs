//! Lessons: from a recording to a policy that plays as soon as possible, and then better and better.
//!
//! Behaviour cloning gives the first policy after seconds. SCORE-PPO on copies of the game goes on from it, and each
//! policy that returns at least as much as the best one so far replaces it, at the same path. So a game that shows the
//! policy shows it getting better.
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
    learn_skills::behaviour_cloning_skills,
    pipeline,
    pipeline::PipelineError,
    policy_export::{ExportError, Provenance, export_policy, policy_file},
    run_dir::{RunDir, is_unstarted},
    run_observer::{CountedWork, Counter, RunEvent, RunObserver},
    train_run::{NewRun, Training, TrainingError, TrainingSetup},
};
use bevy_playbot::{
    demo::file::{DemoFileError, find_demos},
    lesson::LessonStage,
};
use playbot_harness::{
    game::Game,
    sealed_file::{SealedFileError, file_checksum},
};
use playbot_learner::{HasExitCode, SkillModel, disk};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Name of the policy in the folder of a lesson.
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
    /// Folder of all lessons of this game. Each state of the recordings has a folder of its own in it, in which a later
    /// call goes on.
    pub folder: &'a Path,
    /// Circumstances of the training.
    pub setup: &'a TrainingSetup<'a>,
}

/// A policy that was learned, in the file that has the best one.
#[derive(Clone, Copy, Debug)]
pub struct Learned<'a> {
    /// The file.
    pub file: &'a Path,
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
/// The same call goes on where it was stopped. More recordings begin a lesson of their own, and the old one stays.
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
    let experiment = Experiment { demos: Some(plan.recordings.to_owned()), ..plan.experiment.clone() };
    let own = plan.folder.join(checksum(plan.recordings)?);
    disk::create_dir_all(&own).map_err(playbot_harness::sealed_file::io_error("create", &own))?;
    let skill_file = own.join("skills.safetensors");
    let skills = match pipeline::learn_skills(plan.game, &experiment, &skill_file, plan.setup, observer) {
        Ok(skills) => skills,
        Err(PipelineError::Stopped(_)) => return Ok(false),
        Err(error) => return Err(error.into()),
    };
    let run = own.join("run");
    let mut training = begin(plan, &experiment, &skills, &skill_file, &run, observer)?;
    let file = plan.folder.join(LEARNED);
    let mut best = f64::NEG_INFINITY;
    if training.trainer.steps() == 0 {
        imitated(plan, &experiment, &skills, &file)?;
        learned(Learned { file: &file, stage: LessonStage::Imitation, steps: 0, mean_return: None });
    }
    let mut is_first = true;
    loop {
        let mut slice = Slice { observer, is_first, updates: 0, mean_return: None };
        let is_done = training.drive(&mut slice)?;
        let Slice { mean_return, updates, .. } = slice;
        is_first = false;
        let is_best = mean_return.is_some_and(|mean| mean >= best);
        if updates > 0 && is_best {
            best = mean_return.unwrap_or(best);
            let policy = pipeline::policy(plan.game, &training.trainer);
            export_policy(plan.game, &policy, &experiment.train, experiment.seed, &file)?;
            let steps = training.trainer.steps();
            learned(Learned { file: &file, stage: LessonStage::Training, steps, mean_return });
        }
        if is_done || observer.stopped() {
            observer.observe(RunEvent::TrainingEnded);
            return Ok(is_done);
        }
    }
}

/// Returns a name for these recordings that changes with them.
fn checksum(recordings: &Path) -> Result<String, LessonError> {
    let files = find_demos(recordings)?;
    let sums = files.iter().map(|file| file_checksum(file)).collect::<Result<Vec<_>, _>>()?;
    Ok(match sums.as_slice() {
        [one] => one.clone(),
        // An order of files is part of what is learned from.
        many => format!("{:08x}", crc32fast::hash(many.join(" ").as_bytes())),
    })
}

/// Begins the training, or goes on with it.
fn begin(
    plan: &LessonPlan<'_>,
    experiment: &Experiment,
    skills: &SkillModel,
    skill_file: &Path,
    run: &Path,
    observer: &mut dyn RunObserver,
) -> Result<Training, LessonError> {
    if run.exists() && !is_unstarted(run) {
        let opened = RunDir::open_to_write(run).map_err(TrainingError::from)?;
        let wanted = experiment.without_study();
        let saved = opened.experiment.clone();
        if (Experiment { steps: wanted.steps, checkpoints: wanted.checkpoints, ..saved.clone() }) != wanted {
            let run = PathBuf::from(run);
            return Err(PipelineError::OtherSettings { run, wanted: wanted.into(), saved: saved.into() }.into());
        }
        return Ok(Training::resume(plan.game, opened, &wanted, plan.setup)?);
    }
    let new = NewRun {
        path: run,
        experiment,
        skills: Some(skills),
        skill_file: Some(skill_file),
        init_from: None,
        force: false,
    };
    Ok(Training::begin(plan.game, &new, plan.setup, observer)?)
}

/// Writes the policy of behaviour cloning.
fn imitated(
    plan: &LessonPlan<'_>,
    experiment: &Experiment,
    skills: &SkillModel,
    file: &Path,
) -> Result<(), LessonError> {
    let seen = skills.demos().cloned();
    let training = seen.as_ref().map_or_else(|| "recordings".to_owned(), |seen| format!("recordings of {seen}"));
    let code = format!("playbot {}", env!("CARGO_PKG_VERSION"));
    let provenance = Provenance { algorithm: "bc".to_owned(), training, seen, code };
    let cloned = behaviour_cloning_skills(skills, experiment);
    let policy = policy_file(plan.game, &experiment.observation_config(), skills.policy(), Some(cloned), provenance);
    Ok(export_policy(plan.game, &policy, &experiment.train, experiment.seed, file)?)
}

/// An observer that stops after one update, so that its policy can be written. To the observer behind it, all updates are
/// one training.
struct Slice<'a> {
    observer: &'a mut dyn RunObserver,
    is_first: bool,
    updates: u64,
    mean_return: Option<f64>,
}

impl RunObserver for Slice<'_> {
    fn stopped(&self) -> bool {
        self.updates > 0 || self.observer.stopped()
    }

    fn observe(&mut self, event: RunEvent<'_>) {
        match &event {
            RunEvent::Updated { report, .. } => {
                self.updates += 1;
                self.mean_return = report.episodic_return;
            }
            RunEvent::TrainingBegun { .. } if !self.is_first => return,
            RunEvent::TrainingEnded => return,
            _ => {}
        }
        self.observer.observe(event);
    }

    fn counter(&mut self, work: CountedWork<'_>) -> Counter {
        self.observer.counter(work)
    }
}
