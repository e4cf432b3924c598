//! All steps from recordings to a policy, as functions: [`record`], [`learn_skills`], [`train`], [`evaluate`],
//! [`policy`]. They are those of the command line, and resume what an earlier call began.
//!
//! ```no_run
//! use playbot_harness::{eval::Player, prelude::*};
//! use playbot_learner::DeviceKind;
//! use playbot_train::{
//!     UpdateReport,
//!     experiment::file::parse_experiment,
//!     pipeline,
//!     run_observer::{AfterUpdate, Unobserved},
//!     train_run::TrainingSetup,
//! };
//! # fn steps(game: &dyn Game) -> Result<(), Box<dyn std::error::Error>> {
//! let text = r#"(game: "lander", train: "moon:0..63", test: "moon:64..127", demos: "lander.demo", steps: 100000)"#;
//! let experiment = parse_experiment(text, "lander.ron".as_ref())?;
//! pipeline::record(game, &"moon:128..255".parse()?, 0.1, "lander.demo".as_ref())?;
//! let setup = TrainingSetup::new(DeviceKind::default(), 2);
//! let file = "skills.safetensors".as_ref();
//! let skills = pipeline::learn_skills(game, &experiment, file, &setup, &mut Unobserved)?;
//! let mut observer =
//!     AfterUpdate(|report: &UpdateReport| println!("{} steps, return {:?}", report.step, report.episodic_return));
//! let run = "runs/lander".as_ref();
//! let trainer = pipeline::train(game, &experiment, Some((file, &skills)), run, &setup, &mut observer)?;
//! let policy = pipeline::policy(game, &trainer);
//! let player = Player::of_file(&policy, ActionDraw::Sample);
//! let measured = pipeline::evaluate(game, &experiment, "score-ppo", &player, trainer.seen(), 2)?;
//! println!("{:.0} % success on {}", 100.0 * measured.success, measured.split);
//! playbot_train::policy_export::export_policy(game, &policy, &experiment.train, 1, "lander.policy".as_ref())?;
//! # Ok(())
//! # }
//! ```

use crate::{
    Experiment, Trainer,
    experiment::ExperimentError,
    learn_skills::{LearnSkillsError, learn_into},
    policy_export::{Provenance, policy_file},
    recordings::{RecordingsError, find_recordings, read_dataset},
    run_dir::{RunDir, RunError, is_unstarted},
    run_observer::RunObserver,
    runs::settings_that_differ,
    train_run::{NewRun, Training, TrainingError, TrainingSetup},
};
use bevy_playbot::{
    demo::file::{DemoFileError, DemoWriter},
    fault::Fault,
    prelude::*,
};
use playbot_harness::{
    demo::demonstration::DemonstrationPlan,
    eval,
    eval::{EvalError, EvalPlan, EvalSummary, Player, summarize},
    game::Game,
    held_out::{HeldOut, KnownLevels},
    mode::ModeError,
    randomise::Randomise,
    split::LevelSplit,
};
use playbot_learner::{FileError, HasExitCode, PolicyFile, SeenLevels, SkillModel};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Failure of a step.
#[derive(Debug, Error)]
pub enum PipelineError {
    /// The game has no demonstrator.
    #[error("`{0}` has no demonstrator: play it yourself, or train without demonstrations")]
    NoDemonstrator(&'static str),
    /// An invalid mode.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// An invalid experiment.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    /// A recording that cannot be written.
    #[error(transparent)]
    Demo(#[from] DemoFileError),
    /// Recordings that cannot be learned from.
    #[error(transparent)]
    Recordings(Box<RecordingsError>),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// Failure to learn skills.
    #[error(transparent)]
    Skills(Box<LearnSkillsError>),
    /// A skill model that cannot be read.
    #[error(transparent)]
    Model(#[from] FileError),
    /// The folder of the run cannot be used.
    #[error(transparent)]
    Run(Box<RunError>),
    /// The folder holds a run of other settings.
    #[error(
        "{} holds a run with other settings: {}; use the same settings or another folder", run.display(),
        settings_that_differ(wanted, saved)
    )]
    OtherSettings {
        /// The folder.
        run: PathBuf,
        /// The experiment.
        wanted: Box<Experiment>,
        /// The experiment of the run.
        saved: Box<Experiment>,
    },
    /// Failure of training.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// The observer stopped the work. The same call resumes it.
    #[error("stopped and saved in {}: call it again to go on", .0.display())]
    Stopped(PathBuf),
    /// Failure of the evaluation.
    #[error(transparent)]
    Eval(#[from] EvalError),
}

impl HasExitCode for PipelineError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::NoDemonstrator(_) | Self::OtherSettings { .. } => 3,
            Self::Mode(error) => error.exit_code(),
            Self::Experiment(error) => error.exit_code(),
            Self::Demo(error) => error.exit_code(),
            Self::Recordings(error) => error.exit_code(),
            Self::Fault(error) => error.exit_code(),
            Self::Skills(error) => error.exit_code(),
            Self::Model(error) => error.exit_code(),
            Self::Run(error) => error.exit_code(),
            Self::Training(error) => error.exit_code(),
            Self::Stopped(_) => 130,
            Self::Eval(error) => error.exit_code(),
        }
    }
}

impl From<RecordingsError> for PipelineError {
    fn from(error: RecordingsError) -> Self {
        Self::Recordings(error.into())
    }
}

impl From<LearnSkillsError> for PipelineError {
    fn from(error: LearnSkillsError) -> Self {
        Self::Skills(error.into())
    }
}

impl From<RunError> for PipelineError {
    fn from(error: RunError) -> Self {
        Self::Run(error.into())
    }
}

/// Records the game's demonstrator on each of these levels into a new file, and returns the number of episodes.
///
/// `noise` is the share of random actions, or the deviation of continuous ones. It is drawn from seed 1, the default
/// of the command line.
///
/// # Errors
///
/// The game has no demonstrator, it broke its contract, the file exists, or the file cannot be written.
pub fn record(game: &dyn Game, levels: &LevelSplit, noise: f64, path: &Path) -> Result<u64, PipelineError> {
    levels.check(game)?;
    if game.tools().bots.demonstrator().is_none() {
        return Err(PipelineError::NoDemonstrator(game.name()));
    }
    let plan = DemonstrationPlan {
        mode: levels.mode.clone(),
        levels: levels.levels().collect(),
        noise,
        seed: 1,
        steps: None,
        keep_observations: false,
        randomise: Randomise::default(),
    };
    let writer = DemoWriter::create(path, plan.header(game))?;
    let (mut world, agent) = plan.build_world(game, writer);
    while Control::of(&world, agent).is_active() {
        world.tick()?;
    }
    Ok(world.resource::<Recorder>().episodes())
}

/// Learns the skill model of an experiment from its recordings, and writes it to `file`. Unfinished learning is resumed
/// from the checkpoint beside it, and a finished model in the file is returned.
///
/// # Errors
///
/// The experiment names no recordings, they cannot be read or do not replay, a loss is not a number, or a file cannot
/// be written. [`PipelineError::Stopped`] if the observer stopped it.
pub fn learn_skills(
    game: &dyn Game,
    experiment: &Experiment,
    file: &Path,
    setup: &TrainingSetup<'_>,
    observer: &mut dyn RunObserver,
) -> Result<SkillModel, PipelineError> {
    if file.exists() {
        return finished_skills(&experiment.with_sets(game), file, setup);
    }
    experiment.check_agent(game)?;
    let path = find_recordings(experiment, setup.recordings, observer)?;
    let dataset = read_dataset(game, experiment, &path, setup.threads, observer)?;
    let learned = learn_into(file, &experiment.with_sets(game), dataset, setup.device, observer)?;
    learned.ok_or_else(|| PipelineError::Stopped(file.into()))
}

/// Returns the model in a file, if it has the experiment's settings.
fn finished_skills(
    experiment: &Experiment,
    file: &Path,
    setup: &TrainingSetup<'_>,
) -> Result<SkillModel, PipelineError> {
    let model = SkillModel::load(file, setup.device)?;
    if *model.config() == experiment.skills {
        return Ok(model);
    }
    let begun = Experiment { skills: model.config().clone(), ..experiment.clone() };
    let (wanted, begun) = (Box::new(experiment.clone()), Box::new(begun));
    Err(LearnSkillsError::OtherSettings { path: file.into(), wanted, begun }.into())
}

/// Trains to the end of the experiment in the folder `run`, with its metrics and checkpoints. A run that is there
/// already is resumed; its experiment may differ in its steps and its checkpoints only. `skills` are the skill model
/// and its file.
///
/// # Errors
///
/// See [`TrainingError`]. [`PipelineError::OtherSettings`] for another run in the folder, and
/// [`PipelineError::Stopped`] if the observer stopped the training.
pub fn train(
    game: &dyn Game,
    experiment: &Experiment,
    skills: Option<(&Path, &SkillModel)>,
    run: &Path,
    setup: &TrainingSetup<'_>,
    observer: &mut dyn RunObserver,
) -> Result<Trainer, PipelineError> {
    let mut training = begin_or_resume(game, experiment, skills, run, setup, observer)?;
    match training.drive(observer)? {
        true => Ok(training.trainer),
        false => Err(PipelineError::Stopped(run.into())),
    }
}

/// Begins a run in a folder, or resumes the one that is there, as [`train`] does.
pub(crate) fn begin_or_resume(
    game: &dyn Game,
    experiment: &Experiment,
    skills: Option<(&Path, &SkillModel)>,
    run: &Path,
    setup: &TrainingSetup<'_>,
    observer: &mut dyn RunObserver,
) -> Result<Training, PipelineError> {
    if run.exists() && !is_unstarted(run) {
        let opened = RunDir::open_to_write(run)?;
        let (steps, checkpoints) = (experiment.steps, experiment.checkpoints);
        let wanted = experiment.without_study();
        if (Experiment { steps, checkpoints, ..opened.experiment.clone() }) != wanted {
            let (wanted, saved) = (Box::new(wanted), Box::new(opened.experiment));
            return Err(PipelineError::OtherSettings { run: run.into(), wanted, saved });
        }
        return Ok(Training::resume(game, opened, &wanted, setup)?);
    }
    let (skill_file, skills) = skills.unzip();
    let new = NewRun { path: run, experiment, skills, skill_file, from: None, force: false };
    Ok(Training::begin(game, &new, setup, observer)?)
}

/// Measures a player on the experiment's held-out levels, each equally often. `name` is the name in the summary.
///
/// Levels that are known by what was `seen`, such as [`Trainer::seen`], are left out: those of an equal layout, or that
/// play alike. They are measured if the experiment asks for it (`eval.include_seen`), or if there are no others.
///
/// # Errors
///
/// The mode is invalid, the game broke its contract, or it does not support the experiment's observations.
pub fn evaluate(
    game: &dyn Game,
    experiment: &Experiment,
    name: &str,
    player: &Player,
    seen: Option<&SeenLevels>,
    threads: usize,
) -> Result<EvalSummary, PipelineError> {
    experiment.check_test(game)?;
    let held_out = HeldOut::new(game, &experiment.test);
    let known = seen.map(|seen| held_out.seen_in(seen, &|_, _| {})).unwrap_or_default();
    let keeps_all = experiment.eval.include_seen || known.len() as u64 == experiment.test.len();
    let KnownLevels { left_out, seen, layouts } = held_out.without(known, keeps_all);
    let plan = EvalPlan { left_out, ..experiment.eval_plan(&experiment.test, threads) };
    let summary = summarize(name, &plan.split, &eval::evaluate(game, player, &plan, |_| {})?);
    Ok(EvalSummary { seen, layouts, ..summary })
}

/// Returns the policy learned so far, as the file that a game ships with.
///
/// [`export_policy`](crate::policy_export::export_policy) writes it, and
/// [`install_policy`](bevy_playbot::policy_file::install_policy) lets a game play with it.
pub fn policy(game: &dyn Game, trainer: &Trainer) -> PolicyFile {
    let experiment = trainer.experiment();
    let provenance = Provenance {
        algorithm: experiment.algorithm.name().to_owned(),
        training: format!("{} steps on {}, seed {}", trainer.steps(), experiment.train, experiment.seed),
        seen: trainer.seen().cloned(),
        code: format!("playbot {}", env!("CARGO_PKG_VERSION")),
    };
    policy_file(game, &experiment.observation_config(), trainer.policy(), trainer.skill_source(), provenance)
}
