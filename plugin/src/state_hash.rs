//! A fingerprint of the game's state, by which a replay proves that it is the same run.

use bevy::prelude::*;

/// Hash of everything that decides how the agent's arena goes on, written by the game after its own step.
///
/// A game that leaves it at zero can be recorded and replayed, but a replay then proves nothing.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StateHash(pub u64);

impl StateHash {
    /// The 32 bits that recordings keep: both halves folded together.
    pub fn folded(&self) -> u32 {
        (self.0 ^ (self.0 >> 32)) as u32
    }
}
