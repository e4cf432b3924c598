//! Soak test of many agents with cameras: speed, stale frames and memory over many ticks.
//!
//! `camera_soak [ticks] [agents]`

#![allow(clippy::print_stdout)]

use std::time::Instant;

use bevy::prelude::*;
use bevy_playbot::headless::PlaybotAppExt;
use playbot_tests::{scene, soak::soak};

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
    soak(&mut world, &agents, ticks, |_| String::new());
}
