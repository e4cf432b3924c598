//! The benchmarks of a game's speed.

use bevy_playbot::vision::ObservationKind;

/// One measurement of speed.
#[derive(Clone, Copy, Debug)]
pub struct Benchmark {
    /// Its name, after the game's.
    pub case: &'static str,
    /// Mode that is played.
    pub mode: &'static str,
    /// The agents' observation.
    pub observation: ObservationKind,
    /// Whether a learner trains as well.
    pub train: bool,
}

impl Benchmark {
    /// Creates a benchmark of random actions in this mode, with state vectors.
    pub const fn simulate(case: &'static str, mode: &'static str) -> Self {
        Self { case, mode, observation: ObservationKind::Vector, train: false }
    }

    /// Creates a benchmark of PPO in this mode, on state vectors.
    pub const fn train(case: &'static str, mode: &'static str) -> Self {
        Self { train: true, ..Self::simulate(case, mode) }
    }

    /// Replaces the observation.
    pub const fn seeing(self, observation: ObservationKind) -> Self {
        Self { observation, ..self }
    }

    /// Returns the full name, with that of the game: `sim/coinrun/vector`.
    pub fn name(&self, game: &str) -> String {
        format!("{}/{game}/{}", if self.train { "train" } else { "sim" }, self.case)
    }
}
