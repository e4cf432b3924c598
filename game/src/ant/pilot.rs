//! The walker that comes with the program: a policy, trained in the game `ant`, that walks in a commanded direction.

use crate::ant::skeleton::{AntState, JOINTS, SENSES, senses};
use bevy::math::Vec2;
use playbot_assets::ANT_WALKER;
use playbot_learner::{ActionValue, DeviceKind, FileError, LearnError, Policy, PolicyFile};
use std::{path::Path, sync::LazyLock};
use thiserror::Error;

const NAME: &str = "assets/models/ant-walker.safetensors";

static SHIPPED: LazyLock<Result<Pilot, PilotError>> = LazyLock::new(|| Pilot::from_bytes(NAME, ANT_WALKER));

/// The walker that comes with the program does not work.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("the ant's walker cannot walk: {0}")]
pub struct PilotError(String);

impl From<FileError> for PilotError {
    fn from(error: FileError) -> Self {
        Self(error.to_string())
    }
}

impl From<LearnError> for PilotError {
    fn from(error: LearnError) -> Self {
        Self(error.to_string())
    }
}

/// A policy that walks towards any position.
#[derive(Clone, Debug)]
pub struct Pilot(Policy);

/// Observations of pilots: a row of [`SENSES`] numbers to an ant.
#[derive(Clone, Debug, Default)]
pub struct PilotInput(Vec<f32>);

impl PilotInput {
    /// Forgets all ants.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Adds an ant with its goal, `[x, y]` in metres.
    pub fn push(&mut self, state: &AntState, goal: [f32; 2]) {
        self.0.extend(senses(state, Vec2::from(goal)));
    }

    fn len(&self) -> usize {
        self.0.len() / SENSES
    }
}

impl Pilot {
    /// Returns the walker that comes with the program.
    ///
    /// # Errors
    ///
    /// This machine computes other numbers than the one that made the file.
    pub fn shipped() -> Result<&'static Self, PilotError> {
        SHIPPED.as_ref().map_err(Clone::clone)
    }

    /// Reads the walker in a policy file for the game `ant`; `name` is for messages.
    ///
    /// # Errors
    ///
    /// It is no policy file, or its policy has other observations.
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<Self, PilotError> {
        let policy = PolicyFile::from_bytes(Path::new(name), bytes, DeviceKind::default())?.policy;
        if policy.obs_dim() != SENSES {
            let reads = policy.obs_dim();
            return Err(PilotError(format!("{name} reads {reads} values, but an ant senses {SENSES}")));
        }
        Ok(Self(policy))
    }

    /// Returns the torques for each ant, computed in one pass: the most probable ones.
    ///
    /// # Errors
    ///
    /// The policy returns a value that is no number, or another number of torques.
    pub fn act(&self, input: &PilotInput) -> Result<Vec<[f32; JOINTS]>, PilotError> {
        let output = self.0.forward(&[], &input.0[..], input.len())?;
        let row = |row| match output.greedy(row) {
            ActionValue::Continuous(torques) => <[f32; JOINTS]>::try_from(torques).ok(),
            ActionValue::Discrete(_) | ActionValue::Mixed { .. } => None,
        };
        let torques: Option<Vec<_>> = (0..input.len()).map(row).collect();
        torques.ok_or_else(|| PilotError(format!("its policy does not act with {JOINTS} torques")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_pilot_pushes_each_ant_its_own_way() {
        let pilot = Pilot::shipped().expect("comes with the program");
        let state = AntState::nominal();
        let mut input = PilotInput::default();
        [[8.0, 0.0], [0.0, 8.0], [8.0, 0.0], [2.0, 0.0]].iter().for_each(|&goal| input.push(&state, goal));
        let torques = pilot.act(&input).expect("numbers");
        assert_eq!(torques[0], torques[2]);
        assert_eq!(torques[0], torques[3], "how far it is does not matter");
        assert_ne!(torques[0], torques[1]);
        input.clear();
        assert!(pilot.act(&input).expect("nothing to do").is_empty());
    }

    #[test]
    fn other_files_are_refused_by_name() {
        let error = Pilot::from_bytes("legs.safetensors", b"nothing").expect_err("no policy").to_string();
        assert!(error.contains("legs.safetensors"), "{error}");
    }
}
