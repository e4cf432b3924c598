//! The ant that walks where it is told: a policy that the game [`ant`](crate::ant) taught, shipped with the program.

use std::{path::Path, sync::LazyLock};

use bevy::math::Vec2;
use bevy_playbot::learner::{Action, DeviceKind, FileError, LearnError, Policy, PolicyFile};
use thiserror::Error;

use crate::ant::{
    AntState,
    sense::{SENSES, senses},
    skeleton::JOINTS,
};

const NAME: &str = "assets/models/ant-walker.safetensors";
const FILE: &[u8] = include_bytes!("../../../assets/models/ant-walker.safetensors");

static SHIPPED: LazyLock<Result<Walker, WalkerError>> = LazyLock::new(|| Walker::from_bytes(NAME, FILE));

/// The walker cannot walk.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("the ant's walker cannot walk: {0}")]
pub struct WalkerError(String);

impl From<FileError> for WalkerError {
    fn from(error: FileError) -> Self {
        Self(error.to_string())
    }
}

impl From<LearnError> for WalkerError {
    fn from(error: LearnError) -> Self {
        Self(error.to_string())
    }
}

/// A policy that walks towards goals.
#[derive(Clone, Debug)]
pub struct Walker(Policy);

/// What walkers sense: a row of [`SENSES`] numbers to an ant.
#[derive(Clone, Debug, Default)]
pub struct WalkerInput(Vec<f32>);

impl WalkerInput {
    /// Forgets all ants.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Adds an ant that should go to this place, `[x, y]` in metres.
    pub fn push(&mut self, state: &AntState, goal: [f32; 2]) {
        self.0.extend(senses(state, Vec2::from(goal)));
    }

    fn len(&self) -> usize {
        self.0.len() / SENSES
    }
}

impl Walker {
    /// The walker that comes with the program.
    ///
    /// # Errors
    ///
    /// This machine computes something else than the one that made the file.
    pub fn shipped() -> Result<&'static Self, WalkerError> {
        SHIPPED.as_ref().map_err(Clone::clone)
    }

    /// The walker in a policy file for the game `ant`; `name` is for messages.
    ///
    /// # Errors
    ///
    /// It is no policy file, or its policy senses something else.
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<Self, WalkerError> {
        let policy = PolicyFile::from_bytes(Path::new(name), bytes, DeviceKind::default())?.policy;
        if policy.obs_dim() != SENSES {
            let reads = policy.obs_dim();
            return Err(WalkerError(format!("{name} reads {reads} values, but an ant senses {SENSES}")));
        }
        Ok(Self(policy))
    }

    /// The torques for each ant, in one pass: the most probable ones.
    ///
    /// # Errors
    ///
    /// The policy says something that is no number, or acts with another number of torques.
    pub fn act(&self, input: &WalkerInput) -> Result<Vec<[f32; JOINTS]>, WalkerError> {
        let output = self.0.forward(&[], &input.0[..], input.len())?;
        let row = |row| match output.greedy(row) {
            Action::Continuous(torques) => <[f32; JOINTS]>::try_from(torques).ok(),
            Action::Discrete(_) => None,
        };
        let torques: Option<Vec<_>> = (0..input.len()).map(row).collect();
        torques.ok_or_else(|| WalkerError(format!("its policy does not act with {JOINTS} torques")))
    }
}
