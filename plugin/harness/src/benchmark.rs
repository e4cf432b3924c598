//! The benchmarks of a game's speed, and the clock that they read.

use bevy::prelude::*;
use bevy_playbot::{engine::TickSchedules, systems::PlaybotSystems, vision::ObservationKind};
use std::time::Instant;

/// One measurement of speed.
#[derive(Clone, Copy, Debug)]
pub struct Benchmark {
    /// Its name, after the game's.
    pub case: &'static str,
    /// Mode that is played.
    pub mode: &'static str,
    /// The agents' observation.
    pub observation: ObservationKind,
    /// True if a learner trains as well.
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

/// Seconds spent in the parts of a tick. Insert the resource to measure; without it no clock is read.
#[derive(Resource, Debug, Clone, Reflect)]
#[reflect(Resource)]
pub struct StageClock {
    last: Instant,
    /// Building levels and the game's own step, seconds.
    pub simulate_s: f64,
    /// Filling observations, seconds.
    pub observe_s: f64,
    /// Drawing skills and choosing actions, seconds.
    pub infer_s: f64,
    /// Counting, recording and collecting, seconds.
    pub record_s: f64,
}

impl Default for StageClock {
    fn default() -> Self {
        Self { last: Instant::now(), simulate_s: 0.0, observe_s: 0.0, infer_s: 0.0, record_s: 0.0 }
    }
}

impl StageClock {
    /// Returns the seconds since the last call.
    fn lap(&mut self) -> f64 {
        let now = Instant::now();
        let seconds = now.duration_since(self.last).as_secs_f64();
        self.last = now;
        seconds
    }
}

/// Adds systems that read the clock between the parts of a tick.
pub(crate) fn add_readings(app: &mut App) {
    let measuring = resource_exists::<StageClock>;
    let TickSchedules { decide, judge, .. } = TickSchedules::of(app);
    app.add_systems(
        decide,
        (
            start.before(PlaybotSystems::Begin),
            after_simulation.after(PlaybotSystems::Begin).before(PlaybotSystems::Observe),
            after_observation.after(PlaybotSystems::Observe).before(PlaybotSystems::Decide),
            after_decision.after(PlaybotSystems::Act),
        )
            // No other system reads this clock.
            .ambiguous_with_all()
            .run_if(measuring),
    )
    .add_systems(
        judge,
        (after_simulation.before(PlaybotSystems::Judge), after_recording.after(PlaybotSystems::Reset))
            .ambiguous_with_all()
            .run_if(measuring),
    );
}

fn start(mut clock: ResMut<StageClock>) {
    clock.lap();
}

fn after_simulation(mut clock: ResMut<StageClock>) {
    clock.simulate_s += clock.lap();
}

fn after_observation(mut clock: ResMut<StageClock>) {
    clock.observe_s += clock.lap();
}

fn after_decision(mut clock: ResMut<StageClock>) {
    clock.infer_s += clock.lap();
}

fn after_recording(mut clock: ResMut<StageClock>) {
    clock.record_s += clock.lap();
}
