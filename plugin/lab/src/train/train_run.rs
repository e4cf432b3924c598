//! The training of a run: begun or resumed, logged and saved, stopped after any update.

use std::path::{Path, PathBuf};

use playbot_learner::{DeviceKind, HasExitCode, SeenLevels, SkillModel};
use thiserror::Error;

use super::{
    checkpoint::CheckpointChoice,
    config::Experiment,
    recordings::{Recorded, RecordingsError, read_rollouts},
    run_dir::{OpenedRun, RunDir, RunInfo},
    run_error::RunError,
    run_lock::check_new,
    run_observer::{RunEvent, RunObserver},
    train_error::TrainError,
    trainer::Trainer,
};
use crate::{game::Game, held_out::seen_by_training, sealed_file::file_checksum};

/// Failure of a run's training.
#[derive(Debug, Error)]
pub enum TrainingError {
    /// The numbers of a training ran away.
    #[error(
        "{error}; the last good checkpoint is {} of step {step}: try a smaller learning rate or a tighter \
         max_grad_norm in a new run", checkpoint.display()
    )]
    Diverged {
        /// The error about diverged numbers.
        error: Box<TrainError>,
        /// Environment steps of the checkpoint.
        step: u64,
        /// Its folder.
        checkpoint: PathBuf,
    },
    /// A training could not be saved even once.
    #[error(
        "{error}; nothing of {} is saved yet, so there is nothing to go on from: make room or rights and start again \
         (`train` with --force, `study` with --resume)", run.display()
    )]
    NeverSaved {
        /// The reason.
        error: Box<RunError>,
        /// Folder of the run.
        run: PathBuf,
    },
    /// A training could not be saved.
    #[error(
        "{error}; the earlier checkpoints are untouched: make room or rights and go on with \
         `playbot train --run {} --resume`", run.display()
    )]
    NotSaved {
        /// The reason.
        error: Box<RunError>,
        /// Folder of the run.
        run: PathBuf,
    },
    /// The experiment, game and skills do not fit one another, or the training cannot go on.
    #[error(transparent)]
    Train(Box<TrainError>),
    /// The folder of the run cannot be used.
    #[error(transparent)]
    Run(Box<RunError>),
    /// The recordings cannot be trained on.
    #[error(transparent)]
    Recordings(Box<RecordingsError>),
}

impl From<TrainError> for TrainingError {
    fn from(error: TrainError) -> Self {
        Self::Train(error.into())
    }
}

impl From<RunError> for TrainingError {
    fn from(error: RunError) -> Self {
        Self::Run(error.into())
    }
}

impl From<RecordingsError> for TrainingError {
    fn from(error: RecordingsError) -> Self {
        Self::Recordings(error.into())
    }
}

impl HasExitCode for TrainingError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Diverged { .. } => 2,
            Self::NeverSaved { error, .. } | Self::NotSaved { error, .. } => error.exit_code(),
            Self::Train(error) => error.exit_code(),
            Self::Run(error) => error.exit_code(),
            Self::Recordings(error) => error.exit_code(),
        }
    }
}

/// The circumstances of a training that its experiment does not say.
#[derive(Clone, Copy)]
pub struct TrainingSetup<'a> {
    /// Device that computes networks.
    pub device: DeviceKind,
    /// Threads. They change no result.
    pub threads: usize,
    /// Revision of playbot's own code, which runs note.
    pub revision: &'a str,
    /// Returns the path of recordings from the one that an experiment names.
    pub recordings: &'a dyn Fn(&Path) -> PathBuf,
}

impl TrainingSetup<'_> {
    /// Returns a setup with an unknown revision, whose recordings are where experiments say.
    pub fn new(device: DeviceKind, threads: usize) -> Self {
        Self { device, threads, revision: "unknown", recordings: &Path::to_path_buf }
    }
}

/// A run to begin.
#[derive(Clone, Copy)]
pub struct NewRun<'a> {
    /// Its folder.
    pub path: &'a Path,
    /// Its experiment.
    pub experiment: &'a Experiment,
    /// The skill model, if the algorithm needs one.
    pub skills: Option<&'a SkillModel>,
    /// The file of the skill model, whose checksum the run notes.
    pub skill_file: Option<&'a Path>,
    /// Replace an existing run.
    pub force: bool,
}

/// The training of a run: its folder, locked, and its trainer.
pub struct Training {
    /// The folder.
    pub run: RunDir,
    /// The trainer.
    pub trainer: Trainer,
}

impl Training {
    /// Begins a run, with the recordings of its experiment if its algorithm trains on them. The folder is made last.
    ///
    /// # Errors
    ///
    /// [`TrainingError`]; an existing run in the folder stays.
    pub fn begin(
        game: &dyn Game,
        new: &NewRun<'_>,
        setup: &TrainingSetup<'_>,
        observer: &mut dyn RunObserver,
    ) -> Result<Self, TrainingError> {
        let NewRun { experiment, skills, .. } = *new;
        // Before the recordings are replayed, which takes longer.
        check_new(new.path, new.force)?;
        experiment.check_memory(game).map_err(TrainError::from)?;
        let Recorded { rollouts, seen } = read_rollouts(game, experiment, setup.recordings, setup.threads, observer)?;
        let trainer = Trainer::with_demos(game, experiment, skills, &rollouts, setup.device, setup.threads)?;
        let info = run_info(game, new, seen, setup)?;
        let run = RunDir::create(new.path, &experiment.without_study(), &info, new.force)?;
        Ok(Self { run, trainer })
    }

    /// Resumes a run from its last checkpoint. `experiment` is that of the run, or differs in its length or its
    /// checkpoints; it is then saved, unless nothing is left to train.
    ///
    /// # Errors
    ///
    /// [`TrainingError`] if there is no checkpoint, or it does not fit the game.
    pub fn resume(
        game: &dyn Game,
        opened: OpenedRun,
        experiment: &Experiment,
        setup: &TrainingSetup<'_>,
    ) -> Result<Self, TrainingError> {
        let OpenedRun { run, experiment: saved, .. } = opened;
        let trainer = run.resume(game, experiment, setup.device, setup.threads)?;
        if !trainer.is_done() && *experiment != saved {
            run.write_experiment(experiment)?;
        }
        Ok(Self { run, trainer })
    }

    /// Trains to the end of the experiment or until the observer stops it, with log and checkpoints. Returns whether
    /// the end was reached.
    ///
    /// # Errors
    ///
    /// Training or saving fails; the last checkpoint is kept.
    pub fn drive(&mut self, observer: &mut dyn RunObserver) -> Result<bool, TrainingError> {
        let Self { run, trainer } = self;
        trainer.report_panics_to(run.path());
        let (steps_per_update, every) =
            (trainer.experiment().steps_per_update(), trainer.experiment().checkpoints.every);
        observer.observe(RunEvent::TrainingBegun { experiment: trainer.experiment() });
        let mut saved = trainer.updates();
        match run.checkpoint(CheckpointChoice::Last) {
            Ok(checkpoint) => observer.observe(RunEvent::Saved { run: run.path(), step: checkpoint.summary.step }),
            // A later failure then finds a good checkpoint.
            Err(_) => save(run, trainer, observer)?,
        }
        while !trainer.is_done() && !observer.stopped() {
            observer.observe(RunEvent::UpdateBegun { step: trainer.steps() });
            let report = trainer.update().map_err(|error| stopped_by(run, error))?;
            run.log(&report, steps_per_update)?;
            observer.observe(RunEvent::Updated { report: &report, steps_per_update });
            if report.update.is_multiple_of(every) {
                save(run, trainer, observer)?;
                saved = report.update;
            }
        }
        if trainer.updates() > saved {
            save(run, trainer, observer)?;
        }
        observer.observe(RunEvent::TrainingEnded);
        Ok(trainer.is_done())
    }
}

/// Returns the metadata of a new run. `recorded` are the levels of the recordings that it trains on.
///
/// # Errors
///
/// The skill model's file cannot be read.
pub(super) fn run_info(
    game: &dyn Game,
    new: &NewRun<'_>,
    recorded: Option<SeenLevels>,
    setup: &TrainingSetup<'_>,
) -> Result<RunInfo, RunError> {
    let experiment = new.experiment;
    let skill_file = new.skill_file.filter(|_| experiment.algorithm.needs_skills());
    let mut seen = experiment.algorithm.is_trained().then(|| seen_by_training(game, &experiment.train));
    if let Some(recorded) = new.skills.and_then(SkillModel::demos).cloned().or(recorded) {
        seen.get_or_insert_with(|| recorded.clone()).extend(&recorded);
    }
    Ok(RunInfo {
        algorithm: experiment.algorithm,
        seed: experiment.seed,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        revision: setup.revision.to_owned(),
        game_version: game.version(),
        skills: skill_file.map(file_checksum).transpose()?,
        seen,
        device: setup.device,
    })
}

fn save(run: &RunDir, trainer: &mut Trainer, observer: &mut dyn RunObserver) -> Result<(), TrainingError> {
    run.save(trainer).map_err(|error| {
        let is_first = run.checkpoint(CheckpointChoice::Last).is_err();
        let (error, run) = (Box::new(error), run.path().into());
        if is_first { TrainingError::NeverSaved { error, run } } else { TrainingError::NotSaved { error, run } }
    })?;
    observer.observe(RunEvent::Saved { run: run.path(), step: trainer.steps() });
    Ok(())
}

/// Explains an error of a training, with the checkpoint that is left if its numbers diverged.
fn stopped_by(run: &RunDir, error: TrainError) -> TrainingError {
    match (&error, run.checkpoint(CheckpointChoice::Last)) {
        (TrainError::Learn(learn), Ok(checkpoint)) if learn.is_divergence() => {
            let (step, checkpoint) = (checkpoint.summary.step, checkpoint.path);
            TrainingError::Diverged { error: error.into(), step, checkpoint }
        }
        _ => error.into(),
    }
}

/// The end of a training that goes on until it mostly succeeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reached {
    /// Succeeded after this many steps.
    After(u64),
    /// Did not succeed within its steps.
    Never,
    /// Stopped by the observer.
    Stopped,
}

/// Trains until the success rate reaches the threshold of the experiment's study. Nothing is saved.
///
/// # Errors
///
/// [`TrainError`] if experiment, game and skills do not fit one another, or a loss is not a number.
pub fn train_to_success(
    game: &dyn Game,
    experiment: &Experiment,
    skills: Option<&SkillModel>,
    setup: &TrainingSetup<'_>,
    observer: &mut dyn RunObserver,
) -> Result<Reached, TrainError> {
    let mut trainer = Trainer::new(game, experiment, skills, setup.device, setup.threads)?;
    let steps_per_update = experiment.steps_per_update();
    observer.observe(RunEvent::TrainingBegun { experiment });
    let reached = loop {
        if trainer.is_done() {
            break Reached::Never;
        }
        if observer.stopped() {
            break Reached::Stopped;
        }
        let report = trainer.update()?;
        observer.observe(RunEvent::Updated { report: &report, steps_per_update });
        if report.mostly_succeeds(experiment.study.threshold) {
            break Reached::After(report.step);
        }
    };
    observer.observe(RunEvent::TrainingEnded);
    Ok(reached)
}
