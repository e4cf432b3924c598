//! What can go wrong while learning and while reading or writing its files.

use std::path::PathBuf;

/// An error of a learner: a bad setting, data of the wrong size, or numbers that ran away.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LearnError {
    /// A loss, gradient or weight became NaN or infinite.
    #[error("`{tensor}` is not finite after {steps} optimizer steps")]
    NotFinite {
        /// Name of the first tensor that is not finite.
        tensor: String,
        /// Optimizer steps done before.
        steps: u64,
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
    /// A configuration value that cannot work.
    #[error("config: {0}")]
    Config(String),
    /// Data whose length or width does not fit.
    #[error("{what}: expected {expected}, found {found}")]
    Shape {
        /// What was looked at.
        what: String,
        /// The length or width that fits.
        expected: usize,
        /// The length or width that was given.
        found: usize,
    },
    /// Actions of the wrong kind, or a discrete action outside its range.
    #[error("action does not fit the action space: {0}")]
    Action(String),
    /// No window of the wanted length lies inside an episode.
    #[error("no episode is long enough for a window of {window} steps (the longest has {longest})")]
    NoWindow {
        /// Window length in steps.
        window: usize,
        /// Length of the longest episode in steps.
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
}

impl LearnError {
    /// Whether numbers ran away, which no change of the call can cure, but other settings may.
    pub fn is_divergence(&self) -> bool {
        matches!(self, Self::NotFinite { .. } | Self::Exploded { .. })
    }

    /// `Ok` if `found` equals `expected`, else [`LearnError::Shape`].
    pub(crate) fn check(what: &str, expected: usize, found: usize) -> Result<(), Self> {
        if expected == found {
            return Ok(());
        }
        Err(Self::Shape { what: what.to_owned(), expected, found })
    }
}

/// An error of a model or checkpoint file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// Reading, writing, flushing or renaming failed.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// The file is not safetensors, or its description cannot be used.
    #[error("{path}: {detail}")]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        detail: String,
    },
    /// The file was written by a newer version of this program.
    #[error(
        "{path}: was written by a newer version of playbot ({kind} format {found}, this one reads {readable}): update \
         playbot to read it"
    )]
    Newer {
        /// The file.
        path: PathBuf,
        /// What it is.
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
    #[error("{path}: tensor `{name}` belongs to nothing in this model")]
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
    /// A policy does not say of an example what it said when the file was written.
    #[error(
        "{path}: example {example}: {what} is {found}, but was {expected} when the file was written: the file is damaged, \
         or this program computes policies in another way; export the policy again"
    )]
    Example {
        /// The file.
        path: PathBuf,
        /// Number of the example, from 0.
        example: usize,
        /// Which output.
        what: &'static str,
        /// What the file says.
        expected: f32,
        /// What came out.
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
