//! What can go wrong, and the exit code it has.

use std::io;

use bevy_playbot::{
    demo::{file::DemoFileError, verify::VerifyError},
    fault::Fault,
    game::UnknownName,
    learner::{FileError, LearnError},
    runs::RunsError,
    split::SplitError,
    train::{config::ExperimentError, config_file::ConfigError, run_dir::RunError, trainer::TrainError},
};
use thiserror::Error;

/// How a command that worked ended.
pub enum Outcome {
    /// Nothing to complain about.
    Pass,
    /// The command worked and found something wrong in what it looked at.
    Findings,
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
    #[error(transparent)]
    Name(#[from] UnknownName),
    #[error(transparent)]
    Split(#[from] SplitError),
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
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
}

impl CliError {
    /// 3 for what the caller can put right by calling differently, 2 for the rest.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_)
            | Self::Name(_)
            | Self::Split(_)
            | Self::Config(_)
            | Self::Experiment(_)
            | Self::Demo(_)
            | Self::File(_) => 3,
            Self::Run(error) | Self::Runs(RunsError::Run(error)) => run_code(error),
            Self::Train(error) => train_code(error),
            Self::Verify(VerifyError::Fault(_)) => 2,
            Self::Verify(VerifyError::Data(error)) => learn_code(error),
            Self::Learn(error) => learn_code(error),
            Self::Verify(_) => 3,
            Self::BrokenPipe | Self::Io(_) | Self::Fault(_) | Self::Runs(RunsError::Io { .. }) => 2,
            Self::Runs(_) => 3,
        }
    }
}

/// A setting can be put right by the caller; a loss that is no number cannot.
fn learn_code(error: &LearnError) -> u8 {
    if matches!(error, LearnError::NotFinite { .. }) { 2 } else { 3 }
}

fn run_code(error: &RunError) -> u8 {
    match error {
        RunError::Io { .. } => 2,
        RunError::Train(error) => train_code(error),
        _ => 3,
    }
}

fn train_code(error: &TrainError) -> u8 {
    match error {
        TrainError::Fault(_) => 2,
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
    writeln!(io::stdout().lock(), "{line}").map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => CliError::BrokenPipe,
        _ => CliError::Io(format!("cannot write to standard output: {error}")),
    })
}
