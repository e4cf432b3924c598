//! Runs many agents with cameras for many ticks and says how fast, how many frames were stale, and what memory it took.
//!
//! `camera_soak [ticks] [agents]`

#![allow(clippy::print_stdout)]

use std::time::Instant;

use bevy::prelude::*;
use bevy_playbot::{
    headless::{PlaybotAppExt, Tick},
    vision::Frame,
};
use playbot_tests::{memory::resident_kib, scene};

fn main() {
    let mut arguments = std::env::args().skip(1).map(|word| word.parse::<u64>().expect("a number"));
    let (ticks, agents) = (arguments.next().unwrap_or(2000), arguments.next().unwrap_or(64));
    let mut world = scene::camera_world(|app| {
        app.add_systems(FixedUpdate, scene::drift);
    });
    let agents = scene::spawn_large_scene(&mut world, agents as u32);
    let begun = Instant::now();
    world.tick().expect("a sound first tick");
    println!("first tick {:.0} ms", begun.elapsed().as_secs_f64() * 1e3);
    let (mut stale, mut faults, mut best) = (0, 0, f64::INFINITY);
    let chunk = (ticks / 20).max(1);
    for part in 0..ticks / chunk {
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
            "{:>7} ticks  {:.2} ms a tick  {:.0} frames/s  {} MiB resident  {stale} stale  {faults} faults",
            (part + 1) * chunk,
            each * 1e3,
            agents.len() as f64 / each,
            resident_kib() / 1024,
        );
    }
    println!("best {:.2} ms a tick, {:.0} frames/s", best * 1e3, agents.len() as f64 / best);
}
