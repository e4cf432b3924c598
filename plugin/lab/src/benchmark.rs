//! What is measured of a game when its speed is.

use bevy_playbot::vision::ObservationKind;

use crate::game::Game;

/// One measurement of speed.
#[derive(Clone, Copy)]
pub struct Benchmark {
    /// Its name, after the game's.
    pub case: &'static str,
    /// Mode that is played.
    pub mode: &'static str,
    /// What agents see.
    pub observation: ObservationKind,
    /// Whether a learner learns, too.
    pub train: bool,
    /// Another game than the one that names it, such as the same one with physics.
    pub game: Option<&'static dyn Game>,
}

impl Benchmark {
    /// Random actions in this mode, with state vectors.
    pub const fn simulate(case: &'static str, mode: &'static str) -> Self {
        Self { case, mode, observation: ObservationKind::Vector, train: false, game: None }
    }

    /// PPO in this mode, on state vectors.
    pub const fn train(case: &'static str, mode: &'static str) -> Self {
        Self { train: true, ..Self::simulate(case, mode) }
    }

    /// The same, with another observation.
    pub const fn seeing(self, observation: ObservationKind) -> Self {
        Self { observation, ..self }
    }

    /// The same, of another game.
    pub const fn of(self, game: &'static dyn Game) -> Self {
        Self { game: Some(game), ..self }
    }

    /// Its whole name: `sim/coinrun/vector`.
    pub fn name(&self, game: &dyn Game) -> String {
        format!("{}/{}/{}", if self.train { "train" } else { "sim" }, game.name(), self.case)
    }
}
