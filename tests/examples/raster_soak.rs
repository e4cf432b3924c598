//! Plays CoinRun before the raster sensors of many agents for many ticks and says how fast, how many frames were stale or
//! missing, and what memory it took. Levels come and go.
//!
//! `raster_soak [ticks] [agents]`

#![allow(clippy::print_stdout)]

use std::time::Instant;

use bevy::prelude::*;
use bevy_playbot::{
    game::build_seeing_world,
    headless::{PlaybotAppExt, Tick},
    prelude::*,
    vision::{Frame, ObservationKind, Sight},
};
use playbot_games::coinrun::CoinRun;
use playbot_tests::memory::resident_kib;

/// Lines that are printed.
const PARTS: u64 = 20;

fn main() {
    let mut arguments = std::env::args().skip(1).map(|word| word.parse::<u64>().expect("a number"));
    let (ticks, agents) = (arguments.next().unwrap_or(20_000), arguments.next().unwrap_or(64));
    let sight = Sight { kind: ObservationKind::Raster, ..Sight::default() };
    let (mut world, agents) =
        build_seeing_world(&CoinRun::default(), "hard", &sight, 0, 0, agents as u32).expect("a raster needs nothing");
    for &agent in &agents {
        let levels = LevelQueue::Uniform { first: 0, last: 9999 };
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, levels));
    }
    let (mut stale, mut faults, mut best) = (0, 0, f64::INFINITY);
    let chunk = (ticks / PARTS).max(1);
    for part in 1..=ticks / chunk {
        let begun = Instant::now();
        for _ in 0..chunk {
            if let Err(fault) = world.tick() {
                faults += 1;
                println!("{fault}");
            }
            let now = world.resource::<Tick>().0;
            let fresh = |&&agent: &&Entity| world.get::<Frame>(agent).is_some_and(|frame| frame.tick == Some(now));
            stale += agents.len() - agents.iter().filter(fresh).count();
        }
        let each = begun.elapsed().as_secs_f64() / chunk as f64;
        best = best.min(each);
        let episodes: u64 =
            agents.iter().filter_map(|&agent| world.get::<EpisodeCount>(agent)).map(|c| c.finished).sum();
        println!(
            "{:>8} ticks  {:>9} frames  {:.2} ms a tick  {:.0} frames/s  {:.1} MiB resident  {episodes} episodes  \
             {stale} stale  {faults} faults",
            part * chunk,
            part * chunk * agents.len() as u64,
            each * 1e3,
            agents.len() as f64 / each,
            resident_kib() as f64 / 1024.0,
        );
    }
    println!("best {:.2} ms a tick, {:.0} frames/s", best * 1e3, agents.len() as f64 / best);
}
