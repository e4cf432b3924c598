//! What can go wrong, and the exit code it has.

use std::{io, path::PathBuf};

use bevy_playbot::{
    demo::file::{DemoFault, DemoFileError},
    fault::Fault,
    policy_file::PolicyMisfit,
    unknown_name::UnknownName,
    vision::{UnknownObservation, VisionError},
};
use playbot_lab::{
    bugs::BugError,
    demo::verify::VerifyError,
    eval::EvalError,
    findings::{FindingError, Unplayable},
    games::{ForeignArtifact, GamesError},
    inspect::InspectError,
    mode::ModeError,
    policy_export::ExportError,
    runs::RunsError,
    split::SplitError,
    train::{
        TrainError, arena_state::RestoreError, config::ExperimentError, config_file::ConfigError, run_dir::RunError,
        study::StudyError,
    },
    verdict::TestError,
};
use playbot_learner::{FileError, LearnError};
use thiserror::Error;

use super::tell::for_programs;

/// How a command that worked ended.
pub enum Outcome {
    /// Nothing to complain about.
    Pass,
    /// The command worked and found something wrong in what it looked at.
    Findings,
    /// Somebody stopped it before it was done.
    Stopped,
}

/// Why a command did not work.
#[derive(Debug, Error)]
pub enum CliError {
    /// Wrong usage, in words that say what to do.
    #[error("{0}")]
    Usage(String),
    /// The reader of standard output has gone: no fault of ours.
    #[error("standard output was closed")]
    BrokenPipe,
    /// The operating system refused.
    #[error("{0}")]
    Io(String),
    /// The numbers of a training ran away.
    #[error(
        "{error}; the last good checkpoint is {} of step {step}: try a smaller learning rate or a tighter \
         max_grad_norm in a new run", checkpoint.display()
    )]
    Diverged {
        /// What ran away.
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
        /// Why.
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
        /// Why.
        error: Box<RunError>,
        /// Folder of the run.
        run: PathBuf,
    },
    #[error(transparent)]
    Name(#[from] UnknownName),
    #[error(transparent)]
    Games(#[from] GamesError),
    #[error(transparent)]
    ForeignArtifact(#[from] ForeignArtifact),
    #[error(transparent)]
    Inspect(#[from] InspectError),
    #[error(transparent)]
    Mode(#[from] ModeError),
    #[error(transparent)]
    Split(#[from] SplitError),
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    #[error(transparent)]
    Study(#[from] StudyError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[error(transparent)]
    Runs(#[from] RunsError),
    #[error(transparent)]
    Train(#[from] TrainError),
    #[error(transparent)]
    Demo(#[from] DemoFileError),
    #[error(transparent)]
    Verify(#[from] VerifyError),
    #[error(transparent)]
    Learn(#[from] LearnError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Fault(#[from] Fault),
    #[error(transparent)]
    Eval(#[from] EvalError),
    #[error(transparent)]
    Vision(#[from] VisionError),
    #[error(transparent)]
    ObservationConfig(#[from] UnknownObservation),
    #[error(transparent)]
    Misfit(#[from] PolicyMisfit),
    #[error(transparent)]
    Export(#[from] ExportError),
    #[error(transparent)]
    Test(#[from] TestError),
    #[error(transparent)]
    Finding(#[from] FindingError),
    #[error(transparent)]
    Bugs(#[from] BugError),
    #[error(transparent)]
    Unplayable(#[from] Unplayable),
    #[cfg(feature = "window")]
    #[error(transparent)]
    Window(#[from] crate::window::WindowError),
}

impl CliError {
    /// 3 for what the caller can put right by calling differently, 2 for the rest.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_)
            | Self::Name(_)
            | Self::Games(_)
            | Self::ForeignArtifact(_)
            | Self::Inspect(
                InspectError::Usage(_) | InspectError::Name(_) | InspectError::Mode(_) | InspectError::Vision(_),
            )
            | Self::Mode(_)
            | Self::Split(_)
            | Self::Config(_)
            | Self::Experiment(_)
            | Self::Study(_)
            | Self::Misfit(_)
            | Self::Unplayable(_)
            | Self::Vision(_)
            | Self::ObservationConfig(_)
            | Self::Eval(EvalError::Vision(_) | EvalError::Memory(_))
            | Self::Export(ExportError::Vision(_) | ExportError::ObservationConfig(_)) => 3,
            Self::File(error) | Self::Export(ExportError::File(error)) => file_code(error),
            Self::Run(error) | Self::Runs(RunsError::Run(error)) => run_code(error),
            Self::NotSaved { error, .. } | Self::NeverSaved { error, .. } => run_code(error),
            Self::Demo(error) | Self::Verify(VerifyError::File(error)) => demo_code(error),
            Self::Train(error) => train_code(error),
            Self::Test(error) => {
                if error.is_usage() {
                    3
                } else {
                    2
                }
            }
            Self::Finding(error) => {
                if error.is_usage() {
                    3
                } else {
                    2
                }
            }
            Self::Bugs(error) => {
                if error.is_usage() {
                    3
                } else {
                    2
                }
            }
            Self::Verify(VerifyError::Fault { .. }) => 2,
            Self::Verify(VerifyError::Data(error)) => learn_code(error),
            Self::Learn(error) => learn_code(error),
            #[cfg(feature = "window")]
            Self::Window(error) => {
                if error.is_usage() {
                    3
                } else {
                    2
                }
            }
            Self::Verify(_) => 3,
            Self::BrokenPipe
            | Self::Io(_)
            | Self::Fault(_)
            | Self::Inspect(InspectError::Fault(_) | InspectError::Closed)
            | Self::Eval(EvalError::Fault(_))
            | Self::Export(ExportError::Fault(_))
            | Self::Runs(RunsError::Io { .. })
            | Self::Diverged { .. } => 2,
            Self::Runs(_) => 3,
        }
    }
}

/// A setting can be put right by the caller; a loss that is no number cannot.
fn learn_code(error: &LearnError) -> u8 {
    if error.is_divergence() { 2 } else { 3 }
}

fn run_code(error: &RunError) -> u8 {
    match error {
        RunError::Io { .. } => 2,
        RunError::Learner(error) => file_code(error),
        RunError::Train(error) => train_code(error),
        _ => 3,
    }
}

fn file_code(error: &FileError) -> u8 {
    match error {
        FileError::Io { source, .. } => io_code(source),
        _ => 3,
    }
}

fn demo_code(error: &DemoFileError) -> u8 {
    match &error.fault {
        DemoFault::Io { source, .. } => io_code(source),
        DemoFault::PushFailed { .. } | DemoFault::PushTorn { .. } | DemoFault::Torn => 2,
        _ => 3,
    }
}

/// A file that is not there, or a folder in place of one, was named by the caller; a disk that fails was not.
fn io_code(error: &io::Error) -> u8 {
    use io::ErrorKind::{IsADirectory, NotADirectory, NotFound};
    if matches!(error.kind(), NotFound | IsADirectory | NotADirectory) { 3 } else { 2 }
}

fn train_code(error: &TrainError) -> u8 {
    match error {
        TrainError::Fault(_) | TrainError::Restore(RestoreError::Fault(_)) => 2,
        TrainError::Learn(error) => learn_code(error),
        _ => 3,
    }
}

/// Prints one line of data.
///
/// # Errors
///
/// [`CliError::BrokenPipe`] if nobody reads any more.
pub fn print_line(line: impl std::fmt::Display) -> Result<(), CliError> {
    use io::Write;
    let line = line.to_string();
    writeln!(io::stdout().lock(), "{}", for_programs(&line)).map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => CliError::BrokenPipe,
        _ => CliError::Io(format!("cannot write to standard output: {error}")),
    })
}
