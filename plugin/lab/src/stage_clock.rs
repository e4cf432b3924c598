//! Clock of the stages of a tick, for benchmarks.

use std::time::Instant;

use bevy::prelude::*;

use bevy_playbot::{placement::TickSchedules, systems::PlaybotSystems};

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
