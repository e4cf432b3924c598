//! Proofs of a game, for detectors.

use bevy::prelude::*;

use crate::{detector::Proofs, game::Game, proof::LevelProof};

/// The game's proofs about an agent's episode in a World.
pub(crate) struct GameProofs<'a> {
    pub game: &'a dyn Game,
    pub mode: &'a str,
    pub level: u64,
    pub world: &'a World,
    pub agent: Entity,
}

impl Proofs for GameProofs<'_> {
    fn of_level(&self) -> LevelProof {
        self.game.tools().levels.prove(self.mode, self.level)
    }

    fn of_state(&self) -> LevelProof {
        self.game.tools().state.prove_from(self.world, self.agent)
    }
}
