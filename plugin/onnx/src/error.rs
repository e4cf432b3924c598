//! Errors of export and import.

use playbot_learner::{FileError, HasExitCode, LearnError};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Failure to export a policy to ONNX or to import one.
///
/// ```
/// use playbot_onnx::OnnxError;
///
/// let error = OnnxError::Unsupported { node: "Sigmoid (output `y`)".to_owned(), why: "no such layer".to_owned() };
/// assert_eq!(error.to_string(), "the node Sigmoid (output `y`) cannot be imported: no such layer");
/// ```
#[derive(Debug, Error)]
pub enum OnnxError {
    /// A policy file is unsound, or cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The policy cannot compute its outputs.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// The policy file is not of the form that this version exports.
    #[error("{0}: export the policy again with this version")]
    Form(String),
    /// The file is no ONNX model, or it is incomplete.
    #[error("{}: {detail}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The difference.
        detail: String,
    },
    /// A node has no counterpart in a policy.
    #[error("the node {node} cannot be imported: {why}")]
    Unsupported {
        /// Kind, name and outputs of the node.
        node: String,
        /// The reason, and what is possible.
        why: String,
    },
    /// A node cannot be computed.
    #[error("the node {node} cannot be computed: {why}")]
    Compute {
        /// Kind, name and outputs of the node.
        node: String,
        /// The reason.
        why: String,
    },
    /// The graph is of another game, or its inputs or outputs are not those of the game.
    #[error("{0}")]
    Misfit(String),
    /// The translated policy has other outputs than the graph.
    #[error(
        "the translation of the graph is wrong: for observation {row} the number {at} of {output} is {found} instead of \
         {expected}; nothing is written"
    )]
    Differs {
        /// Number of the observation.
        row: usize,
        /// Name of the output.
        output: String,
        /// Number within the output.
        at: usize,
        /// Output of the graph.
        expected: f64,
        /// Output of the policy.
        found: f64,
    },
    /// The system refused to write a file.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
}

impl OnnxError {
    /// Returns an error about a policy file in memory.
    pub(crate) fn policy(name: &Path, detail: String) -> Self {
        Self::Form(format!("{}: {detail}", name.display()))
    }
}

impl HasExitCode for OnnxError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::File(error) => error.exit_code(),
            Self::Learn(error) => error.exit_code(),
            Self::Differs { .. } => 2,
            Self::Write { source, .. } => playbot_learner::io_exit_code(source),
            _ => 3,
        }
    }
}
