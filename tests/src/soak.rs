//! Soak test of many sensors over many ticks: speed, stale or missing frames, and memory.
#![allow(clippy::print_stdout, reason = "it is what a soak is for")]

use std::time::Instant;

use bevy::prelude::*;
use bevy_playbot::{episode::Tick, headless::PlaybotAppExt, vision::Frame};

use crate::memory::resident_kib;

/// Lines that are printed.
const PARTS: u64 = 20;

/// Plays for so many ticks, and prints a line for each twentieth of them, with a note on the World at its end.
pub fn soak(world: &mut World, agents: &[Entity], ticks: u64, note: impl Fn(&World) -> String) {
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
        println!(
            "{:>8} ticks  {:>9} frames  {:.2} ms a tick  {:.0} frames/s  {:.1} MiB resident  {stale} stale  \
             {faults} faults  {}",
            part * chunk,
            part * chunk * agents.len() as u64,
            each * 1e3,
            agents.len() as f64 / each,
            resident_kib() as f64 / 1024.0,
            note(world),
        );
    }
    println!("best {:.2} ms a tick, {:.0} frames/s", best * 1e3, agents.len() as f64 / best);
}
