//! Measurement of players in tests.

use bevy_playbot::vision::ObservationConfig;
use playbot_harness::{eval::EvalPlan, randomise::Randomise};
use std::collections::BTreeSet;

/// Returns a plan of one episode on each of these levels, by four arenas in two Worlds on two threads.
pub fn plan(levels: &str) -> EvalPlan {
    EvalPlan {
        split: levels.parse().expect("a split"),
        left_out: BTreeSet::new(),
        observation_config: ObservationConfig::default(),
        episodes_per_level: 1,
        seed: 1,
        arenas: 4,
        worlds: 2,
        threads: 2,
        randomise: Randomise::default(),
    }
}
