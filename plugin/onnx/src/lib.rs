//! Policies as ONNX files, and ONNX files of other trainers as policies.
//!
//! # Concepts
//!
//! - [`OnnxPolicy`] is a policy file as ONNX graphs: the policy and, if it reads skills, their prior. It is built from
//!   the arrays and the description of the policy file, which `docs/reference/policy-files.md` describes.
//! - [`ImportTarget`] is what a policy must fit, a game's observations and actions. It turns a graph into an
//!   [`ImportedPolicy`], and compares both before it returns.
//! - [`Evaluator`] computes a graph in double precision. It is the reference of that comparison.
//!
//! # Example
//!
//! ```
//! use playbot_learner::{
//!     ActionSpace, DeviceKind, Learner, PolicyFile, PolicyMetadata, PolicySpec, PpoConfig, PpoLearner,
//! };
//! use playbot_onnx::{ImportTarget, OnnxPolicy};
//!
//! let spec = PolicySpec { obs: 2.into(), latent: 0, action_space: ActionSpace::Discrete(3) };
//! let learner = PpoLearner::new(PpoConfig::default(), spec, 1, DeviceKind::Flex)?;
//! let metadata = PolicyMetadata { game: "pong".to_owned(), ..PolicyMetadata::default() };
//! let file = PolicyFile { metadata: metadata.clone(), policy: learner.policy(), skills: None };
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("bot.policy");
//! file.save(&path, &[0.1, 0.2], &[], 1)?;
//!
//! let onnx = OnnxPolicy::of_policy_file(&path, &std::fs::read(&path)?)?;
//! let target = ImportTarget { observation: spec.obs, action_space: spec.action_space, metadata };
//! let back = target.import("bot.onnx".as_ref(), &onnx.policy)?;
//! assert!(back.difference < 1e-5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod evaluator;
mod export;
mod graph;
mod import;
mod messages;
mod policy_form;
#[cfg(test)]
mod tests;

pub use crate::{
    error::OnnxError,
    evaluator::{Elem, Evaluator, Value},
    export::OnnxPolicy,
    import::{ImportTarget, ImportedPolicy},
};

/// Compiles and runs the examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
