//! The learning of a skill model: begun or resumed, saved after each epoch, stopped after any batch.

use crate::{
    error::RunError,
    experiment::Experiment,
    run_observer::{KeptSkills, RunEvent, RunObserver},
    runs::settings_that_differ,
};
use bevy_playbot::{policy::ActionDraw, skill_prior::SkillPrior};
use playbot_harness::{eval::Player, sealed_file::io_error};
use playbot_learner::{
    Dataset, DeviceKind, FileError, HasExitCode, LearnError, SkillModel, SkillSource, SkillTrainer, disk,
};
use std::{
    io,
    ops::ControlFlow,
    path::{Path, PathBuf},
};
use thiserror::Error;

/// Failure to learn a skill model.
#[derive(Debug, Error)]
pub enum LearnSkillsError {
    /// The learner refuses settings or recordings, or a loss is not a number.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The checkpoint cannot be resumed.
    #[error("{source}; {advice}")]
    Unusable {
        /// The error of its file.
        source: FileError,
        /// Advice for the user.
        advice: &'static str,
    },
    /// The checkpoint or the model is of other settings.
    #[error(
        "{} was begun with other settings: {}; use the same settings, or remove the file to start anew", path.display(),
        settings_that_differ(wanted, begun)
    )]
    OtherSettings {
        /// The checkpoint or model.
        path: PathBuf,
        /// The experiment.
        wanted: Box<Experiment>,
        /// The experiment with the settings of the checkpoint.
        begun: Box<Experiment>,
    },
    /// The checkpoint cannot be removed.
    #[error(transparent)]
    Checkpoint(#[from] RunError),
}

impl HasExitCode for LearnSkillsError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Learn(error) => error.exit_code(),
            Self::File(error) => error.exit_code(),
            Self::Checkpoint(error) => error.exit_code(),
            Self::Unusable { .. } | Self::OtherSettings { .. } => 3,
        }
    }
}

/// Learns a model and writes it to `file`. A checkpoint [beside](checkpoint_of) it is resumed if there is one, and
/// removed at the end. `None` if the observer stopped the work, which a later call resumes.
///
/// # Errors
///
/// As for [`learn`], and if the model cannot be written.
pub fn learn_into(
    file: &Path,
    experiment: &Experiment,
    dataset: Dataset,
    device: DeviceKind,
    observer: &mut dyn RunObserver,
) -> Result<Option<SkillModel>, LearnSkillsError> {
    let checkpoint = checkpoint_of(file);
    let Some(model) = learn(experiment, dataset, device, Some(&checkpoint), observer)? else { return Ok(None) };
    model.save(file)?;
    remove_checkpoint(&checkpoint)?;
    Ok(Some(model))
}

/// Learns a model, and with `checkpoint` saves its state there after each epoch. Resumed learning equals uninterrupted
/// learning bit for bit. `None` if the observer stopped it.
///
/// # Errors
///
/// A loss is not a number, the checkpoint is of other learning, or it cannot be read or written.
pub fn learn(
    experiment: &Experiment,
    dataset: Dataset,
    device: DeviceKind,
    checkpoint: Option<&Path>,
    observer: &mut dyn RunObserver,
) -> Result<Option<SkillModel>, LearnSkillsError> {
    let epochs = experiment.skills.epochs as u64;
    let mut trainer = begin(experiment, dataset, device, checkpoint, observer)?;
    let mut last = None;
    let per_epoch = trainer.batches_per_epoch() as u64;
    let done = trainer.epochs_done() * per_epoch + trainer.batches_done() as u64;
    observer.observe(RunEvent::SkillsBegun { done, batches: epochs * per_epoch });
    while trainer.epochs_done() < epochs && !trainer.is_over() {
        let metrics = trainer.train_epoch(&mut |_| {
            observer.observe(RunEvent::SkillBatch);
            if observer.stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        if let Some(checkpoint) = checkpoint {
            trainer.save(checkpoint)?;
            observer.observe(RunEvent::SkillsSaved { checkpoint, epochs: trainer.epochs_done() });
        }
        let Some(metrics) = metrics else {
            observer.observe(RunEvent::SkillsEnded { kept: None });
            return Ok(None);
        };
        last = metrics.held_out_nll();
        observer.observe(RunEvent::SkillEpoch { epoch: trainer.epochs_done(), metrics: &metrics });
    }
    observer.observe(RunEvent::SkillsEnded { kept: kept(&trainer, last) });
    Ok(Some(trainer.into_model().with_picture(experiment.observation_config().picture_metadata())))
}

/// Returns the loss of the kept model on the held-out episodes, if there are any. The kept model is that of the best
/// epoch, or else of the last one, with the loss `last`.
fn kept(trainer: &SkillTrainer, last: Option<f32>) -> Option<KeptSkills> {
    let epochs = trainer.epochs_done();
    match trainer.best_epoch().zip(trainer.best_nll()) {
        Some((epoch, held_out_nll)) => Some(KeptSkills { epoch, epochs, held_out_nll, is_best: true }),
        None => last.map(|held_out_nll| KeptSkills { epoch: epochs, epochs, held_out_nll, is_best: false }),
    }
}

/// Makes a trainer, new or from the checkpoint.
fn begin(
    experiment: &Experiment,
    dataset: Dataset,
    device: DeviceKind,
    checkpoint: Option<&Path>,
    observer: &mut dyn RunObserver,
) -> Result<SkillTrainer, LearnSkillsError> {
    let Some(path) = checkpoint.filter(|checkpoint| checkpoint.exists()) else {
        return Ok(SkillTrainer::new(experiment.skills.clone(), dataset, experiment.seed, device)?);
    };
    let trainer = SkillTrainer::load(path, dataset, device).map_err(unusable)?;
    let begun = Experiment { skills: trainer.config().clone(), seed: trainer.seed(), ..experiment.clone() };
    if begun != *experiment {
        let (wanted, begun) = (Box::new(experiment.clone()), Box::new(begun));
        return Err(LearnSkillsError::OtherSettings { path: path.into(), wanted, begun });
    }
    let epochs = experiment.skills.epochs as u64;
    observer.observe(RunEvent::SkillsResumed { epoch: trainer.epochs_done() + 1, epochs });
    Ok(trainer)
}

/// Adds advice to the error of a checkpoint that cannot be resumed: other recordings are no help against damage.
fn unusable(source: FileError) -> LearnSkillsError {
    let advice = match source {
        FileError::Io { .. } => return source.into(),
        FileError::CutOff { .. } | FileError::Damaged { .. } | FileError::Foreign { .. } => {
            "nothing can go on from it: learn anew with --force"
        }
        FileError::Newer { .. } => "or start anew with --force",
        _ => "go on with the recordings that it began with, or start anew with --force",
    };
    LearnSkillsError::Unusable { source, advice }
}

/// Returns the path of the checkpoint of unfinished learning, beside the file of the model.
pub fn checkpoint_of(file: &Path) -> PathBuf {
    let mut name = file.file_name().unwrap_or_default().to_owned();
    name.push(".checkpoint");
    file.with_file_name(name)
}

/// Removes a checkpoint that is not needed any more, if there is one.
///
/// # Errors
///
/// The system refuses.
pub fn remove_checkpoint(checkpoint: &Path) -> Result<(), RunError> {
    match disk::remove_file(checkpoint) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(io_error("remove", checkpoint)(error).into()),
        _ => Ok(()),
    }
}

/// Returns the player of behaviour cloning: the decoder under the prior, without any reinforcement learning.
pub fn behaviour_cloning(model: &SkillModel, experiment: &Experiment, draw: ActionDraw) -> Player {
    let skills = behaviour_cloning_skills(model, experiment);
    Player::Policy { policy: model.policy(), prior: Some(SkillPrior::from(&skills)), draw }
}

/// Returns the skills of behaviour cloning, with the experiment's skill interval and draw.
pub fn behaviour_cloning_skills(model: &SkillModel, experiment: &Experiment) -> SkillSource {
    let (skill_interval, draw) = (experiment.score.skill_interval, experiment.score.skill_draw);
    SkillSource { prior: model.prior(), decoder: model.policy(), skill_interval, draw }
}
