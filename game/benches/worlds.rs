//! Duration of a tick in one World of each game: simulation and observation of its arenas, under random actions. Duration
//! of building a World, also of a game that has all of Bevy's plugins.
//!
//! `cargo bench -p playbot_games`. `playbot bench` measures whole machines, with pictures and learning.

use std::time::Duration;

use bevy::prelude::{App, KeyCode, World};
use criterion::{Criterion, Throughput};
use playbot::prelude::*;
use playbot_games::GAMES;
use playbot_harness::{
    foreign::ForeignGame,
    worlds::{Arrangement, build_world},
};

const ARENAS: u32 = 16;
const TICKS: u64 = 10;

fn ticks(criterion: &mut Criterion) {
    for game in GAMES {
        for mode in game.modes() {
            let arenas = Arrangement::new(game, ARENAS, 1).arenas;
            let mut world = world(game, mode, arenas);
            let mut group = criterion.benchmark_group(format!("tick/{}", game.name()));
            group.throughput(Throughput::Elements(TICKS * u64::from(arenas)));
            group.bench_function(*mode, |bencher| bencher.iter(|| world.ticks(TICKS).expect("plays")));
            group.finish();
        }
    }
}

fn buildings(criterion: &mut Criterion) {
    let foreign = ForeignGame::new("foreign", 1, |_: &mut App| {})
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["one"], || [1.0])
        .time_limit(1);
    let games = GAMES.iter().copied().chain([&foreign as &dyn Game]);
    let mut group = criterion.benchmark_group("build");
    for game in games {
        group.bench_function(game.name(), |bencher| bencher.iter(|| build_world(game, game.modes()[0], 1, 0, 1)));
    }
    group.finish();
}

/// Returns a World whose agents play at random.
fn world(game: &dyn Game, mode: &str, arenas: u32) -> World {
    let (mut world, agents) = build_world(game, mode, 1, 0, arenas);
    for agent in agents {
        let queue = LevelQueue::Uniform { first: 0, last: 63 };
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, queue));
    }
    world
}

criterion::criterion_group! {
    name = worlds;
    config = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(3));
    targets = ticks, buildings
}
criterion::criterion_main!(worlds);
