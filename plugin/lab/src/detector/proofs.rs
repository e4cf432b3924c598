//! What is known for certain while an episode is played.

use crate::proof::LevelProof;

/// What the game can prove, for detectors that ask. An answer may take a millisecond, so nobody asks in each tick.
pub trait Proofs {
    /// Of the level, from its start: [`Game::prove`](crate::game::Game::prove).
    fn of_level(&self) -> LevelProof {
        LevelProof::Unknown
    }

    /// Of the state in which the World is now: [`Game::prove_from`](crate::game::Game::prove_from).
    fn of_state(&self) -> LevelProof {
        LevelProof::Unknown
    }
}

/// Nothing is ever proved.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProofs;

impl Proofs for NoProofs {}
