//! Errors of learning, and of reading and writing its files.

use std::{error::Error, io, path::PathBuf};

/// An error of a learner: a bad setting, data that do not fit or are not finite, or numbers that diverged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LearnError {
    /// A loss, gradient, weight or output of a network became NaN or infinite.
    #[error("`{tensor}` is not finite{}", after(*steps))]
    NotFinite {
        /// Name of the first tensor that is not finite.
        tensor: String,
        /// Optimizer steps done before; `None` outside of learning, as when a policy plays.
        steps: Option<u64>,
    },
    /// Input data hold a number that is NaN or infinite.
    #[error("{what}: row {row} holds {value}: every number must be finite")]
    Input {
        /// The data.
        what: String,
        /// Number of the first such row, from 0.
        row: usize,
        /// The first such number in it.
        value: f32,
    },
    /// A loss has grown beyond all bounds.
    #[error("`{tensor}` has exploded: it is {value:e} after {steps} optimizer steps")]
    Exploded {
        /// Name of the loss.
        tensor: String,
        /// Its value.
        value: f32,
        /// Optimizer steps done before.
        steps: u64,
    },
    /// An impossible configuration value.
    #[error("config: {0}")]
    Config(String),
    /// An impossible setting.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// Data whose length or width does not fit.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// Name of the checked data.
        what: String,
        /// The required length or width.
        expected: usize,
        /// The given length or width.
        found: usize,
    },
    /// Actions of the wrong kind, or a discrete action outside its range.
    #[error("action does not fit the action space: {0}")]
    Action(String),
    /// No window of the requested length fits into the demonstrations.
    #[error(
        "no window of {window} steps fits into the demonstrations: the longest stretch to cut from has {longest}; record \
         longer episodes, or set `skills.window` lower"
    )]
    NoWindow {
        /// Window length in steps.
        window: usize,
        /// Steps of the longest episode; of all episodes together if windows may cross their ends.
        longest: usize,
    },
    /// A policy copied from the decoder does not act like the decoder.
    #[error("the policy is a copy of the decoder, yet KL(decoder, policy) is {kl} and not exactly 0")]
    InitialKl {
        /// The mean divergence in nats.
        kl: f32,
    },
    /// A value could not be read back from the device.
    #[error("reading a tensor from the device failed: {0}")]
    Device(String),
    /// This program or this machine does not support the device.
    #[error("cannot compute on `{device}`: {reason}; the device `flex` computes on the CPU")]
    NoDevice {
        /// Name of the device.
        device: String,
        /// The missing part.
        reason: String,
    },
    /// A graphics card was lost, or ran out of memory.
    #[error(
        "the graphics card failed: {reason}; saved files are kept: continue with smaller batches or the device `flex`"
    )]
    DeviceFailed {
        /// The driver's message.
        reason: String,
    },
}

impl HasExitCode for LearnError {
    fn exit_code(&self) -> u8 {
        // A setting can be put right by the caller; a loss that is no number cannot.
        if self.is_divergence() { 2 } else { 3 }
    }
}

impl LearnError {
    /// Returns whether numbers diverged. No change of the call can prevent that, but other settings may.
    pub fn is_divergence(&self) -> bool {
        matches!(self, Self::NotFinite { .. } | Self::Exploded { .. })
    }

    /// Checks that `found` equals `expected`, else returns [`LearnError::Shape`].
    pub(crate) fn check(what: &str, expected: usize, found: usize) -> Result<(), Self> {
        if expected == found {
            return Ok(());
        }
        Err(Self::Shape { what: what.to_owned(), expected, found })
    }

    /// Checks that all `values`, `width` to a row, are finite, else returns [`LearnError::Input`].
    pub(crate) fn check_finite(what: &str, width: usize, values: &[f32]) -> Result<(), Self> {
        // x · 0 is 0 for finite numbers and NaN otherwise. Eight sums side by side can be vectorised.
        let (chunks, rest) = values.as_chunks::<8>();
        let mut witness = [0.0f32; 8];
        for chunk in chunks {
            witness.iter_mut().zip(chunk).for_each(|(sum, x)| *sum += x * 0.0);
        }
        if witness.iter().chain(rest).all(|x| x.is_finite()) {
            return Ok(());
        }
        match values.iter().position(|x| !x.is_finite()) {
            None => Ok(()),
            Some(at) => Err(Self::Input { what: what.to_owned(), row: at / width.max(1), value: values[at] }),
        }
    }
}

/// An impossible setting.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{path}` {why}{}", value.as_ref().map_or_else(String::new, |value| format!(", but is {value}")))]
pub struct SettingError {
    /// Path of the setting in an experiment.
    pub path: &'static str,
    /// Its value, where that is wrong by itself.
    pub value: Option<String>,
    /// The requirement that it breaks.
    pub why: String,
}

impl SettingError {
    /// Creates the error of a setting that contradicts another one.
    pub fn new(path: &'static str, why: impl Into<String>) -> Self {
        Self { path, value: None, why: why.into() }
    }
}

/// Returns a number for a message, without hundreds of zeros.
pub fn brief_number(x: f64) -> String {
    if x == 0.0 || (1e-15..1e15).contains(&x.abs()) { x.to_string() } else { format!("{x:e}") }
}

/// Returns the end of a message about numbers that diverged.
fn after(steps: Option<u64>) -> String {
    steps.map_or(String::new(), |steps| format!(" after {steps} optimizer steps"))
}

/// An error of a model or checkpoint file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// Reading, writing, flushing or renaming failed.
    #[error("cannot {action} {path}: {source}")]
    Io {
        /// The attempted action: `read` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The file was not written by this program, or its contents are lost.
    #[error("{path}: {detail}: it is another file; name one that playbot has written")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The missing part.
        detail: String,
    },
    /// The description of the file cannot be used.
    #[error("{path}: {detail}")]
    Format {
        /// The file.
        path: PathBuf,
        /// The problem.
        detail: String,
    },
    /// The file ends too early, or continues behind its end.
    #[error("{path}: the file is cut off{advice}")]
    CutOff {
        /// The file.
        path: PathBuf,
        /// Advice on recovering the file, after a colon; empty if there is none.
        advice: &'static str,
    },
    /// The checksum in the file differs from that of its contents.
    #[error("{path}: the file is damaged: its checksum does not match its contents{advice}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Advice on recovering the file, after a colon; empty if there is none.
        advice: &'static str,
    },
    /// The file was written by a newer version of this program.
    #[error(
        "{path}: was written by a newer version of playbot ({kind} format {found}, this one reads {readable}): update \
         playbot to read it"
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// Kind of the file.
        kind: &'static str,
        /// Its format.
        found: u32,
        /// The format that can be read.
        readable: u32,
    },
    /// A tensor that the model needs is not in the file.
    #[error("{path}: tensor `{name}` is missing")]
    MissingTensor {
        /// The file.
        path: PathBuf,
        /// Name of the tensor.
        name: String,
    },
    /// The file holds a tensor that the model does not have.
    #[error("{path}: tensor `{name}` does not belong to this model")]
    ExtraTensor {
        /// The file.
        path: PathBuf,
        /// Name of the tensor.
        name: String,
    },
    /// A tensor has another shape than the model.
    #[error("{path}: tensor `{name}` has shape {found:?}, expected {expected:?}")]
    WrongShape {
        /// The file.
        path: PathBuf,
        /// Name of the tensor.
        name: String,
        /// The model's shape.
        expected: Vec<usize>,
        /// The file's shape.
        found: Vec<usize>,
    },
    /// A policy's output for a stored example differs from the output stored with it.
    #[error(
        "{path}: example {example}: {what} is {found}, but was {expected} when the file was written: the file is damaged, \
         or this program computes policies in another way; export the policy again"
    )]
    Example {
        /// The file.
        path: PathBuf,
        /// Number of the example, from 0.
        example: usize,
        /// Name of the output.
        what: &'static str,
        /// The stored value.
        expected: f32,
        /// The computed value.
        found: f32,
    },
    /// The description in the file does not make a valid learner.
    #[error("{path}: {source}")]
    Learner {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: LearnError,
    },
}

impl HasExitCode for FileError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Io { source, .. } => io_exit_code(source),
            _ => 3,
        }
    }
}

impl FileError {
    /// Adds advice on recovering the file, if it is cut off or damaged.
    pub(crate) fn or_again(self, advice: &'static str) -> Self {
        match self {
            Self::CutOff { path, .. } => Self::CutOff { path, advice },
            Self::Damaged { path, .. } => Self::Damaged { path, advice },
            other => other,
        }
    }
}

/// An error that knows the exit code of a program that ends with it. Implemented beside each error.
///
/// ```
/// use playbot_learner::{HasExitCode, LearnError};
///
/// let error = LearnError::Config("lr is 0".to_owned());
/// assert_eq!(error.exit_code(), 3);
/// let error = LearnError::Exploded { tensor: "loss".to_owned(), value: 1e30, steps: 7 };
/// assert_eq!((error.exit_code(), error.is_usage()), (2, false));
/// ```
pub trait HasExitCode: Error {
    /// Returns 3 if another call can succeed, 2 if the program, the game or the system failed.
    fn exit_code(&self) -> u8 {
        3
    }

    /// Returns whether another call can succeed.
    fn is_usage(&self) -> bool {
        self.exit_code() == 3
    }
}

/// Returns the exit code of a system's error about a file. A missing file, or a folder in place of one, is the
/// caller's error; a failing disk is not.
pub fn io_exit_code(error: &io::Error) -> u8 {
    use io::ErrorKind::{IsADirectory, NotADirectory, NotFound};
    if matches!(error.kind(), NotFound | IsADirectory | NotADirectory) { 3 } else { 2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_fills_a_line() {
        let numbers = [0.0, -0.5, 1024.0, 123_456_789.5, 1e300, -2.5e15, 3e-300, f64::INFINITY, f64::NEG_INFINITY];
        let words = ["0", "-0.5", "1024", "123456789.5", "1e300", "-2.5e15", "3e-300", "inf", "-inf"];
        assert_eq!(numbers.map(brief_number), words);
        assert_eq!(brief_number(f64::NAN), "NaN");
    }

    #[test]
    fn the_first_row_that_is_not_finite_is_named() {
        let check = |at: usize, value| {
            let mut values = vec![1e38; 21];
            values[at] = value;
            LearnError::check_finite("obs", 3, &values)
        };
        for at in 0..21 {
            for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let error = check(at, value).expect_err("not finite");
                assert!(matches!(&error, LearnError::Input { row, .. } if *row == at / 3), "{error}");
                assert!(!error.is_divergence());
            }
        }
        assert!(check(4, -f32::MAX).is_ok());
        let error = check(7, f32::NAN).expect_err("not finite").to_string();
        assert_eq!(error, "obs: row 2 holds NaN: every number must be finite");
    }
}
