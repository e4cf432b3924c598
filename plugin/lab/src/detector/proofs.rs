//! Proofs about a level and about the state of an episode.

use crate::proof::LevelProof;

/// The game's proofs, on request. One may take a millisecond, so a detector must not ask in each tick.
pub trait Proofs {
    /// Returns the proof about the level, from its start: [`LevelTools::prove`](crate::game::LevelTools::prove).
    fn of_level(&self) -> LevelProof {
        LevelProof::Unknown
    }

    /// Returns the proof about the World's current state:
    /// [`StateTools::prove_from`](crate::game::StateTools::prove_from).
    fn of_state(&self) -> LevelProof {
        LevelProof::Unknown
    }
}

/// A game without proofs.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProofs;

impl Proofs for NoProofs {}
