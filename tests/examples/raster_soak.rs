//! Soak test of CoinRun with the raster sensors of many agents: speed, stale or missing frames, and memory over many
//! ticks. Levels come and go.
//!
//! `raster_soak [ticks] [agents]`

use bevy_playbot::vision::{ObservationConfig, ObservationKind};
use playbot::prelude::*;
use playbot_games::coinrun::CoinRun;
use playbot_harness::worlds::build_observing_world;
use playbot_tests::soak::soak;

fn main() {
    let mut arguments = std::env::args().skip(1).map(|word| word.parse::<u64>().expect("a number"));
    let (ticks, agents) = (arguments.next().unwrap_or(20_000), arguments.next().unwrap_or(64));
    let observation_config = ObservationConfig { kind: ObservationKind::Raster, ..ObservationConfig::default() };
    let (mut world, agents) =
        build_observing_world(&CoinRun::default(), "hard", &observation_config, 0, 0, agents as u32)
            .expect("a raster needs nothing");
    for &agent in &agents {
        let levels = LevelQueue::Uniform { first: 0, last: 9999 };
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, levels));
    }
    soak(&mut world, &agents, ticks, |world| {
        let episodes = agents.iter().filter_map(|&agent| world.get::<EpisodeCount>(agent)).map(|count| count.finished);
        format!("{} episodes", episodes.sum::<u64>())
    });
}
