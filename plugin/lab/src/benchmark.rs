//! What is measured of a game when its speed is.

use bevy_playbot::vision::ObservationKind;

/// One measurement of speed.
#[derive(Clone, Copy, Debug)]
pub struct Benchmark {
    /// Its name, after the game's.
    pub case: &'static str,
    /// Mode that is played.
    pub mode: &'static str,
    /// What agents see.
    pub observation: ObservationKind,
    /// Whether a learner learns, too.
    pub train: bool,
}

impl Benchmark {
    /// Random actions in this mode, with state vectors.
    pub const fn simulate(case: &'static str, mode: &'static str) -> Self {
        Self { case, mode, observation: ObservationKind::Vector, train: false }
    }

    /// PPO in this mode, on state vectors.
    pub const fn train(case: &'static str, mode: &'static str) -> Self {
        Self { train: true, ..Self::simulate(case, mode) }
    }

    /// The same, with another observation.
    pub const fn seeing(self, observation: ObservationKind) -> Self {
        Self { observation, ..self }
    }

    /// Its whole name, with that of the game: `sim/coinrun/vector`.
    pub fn name(&self, game: &str) -> String {
        format!("{}/{game}/{}", if self.train { "train" } else { "sim" }, self.case)
    }
}
