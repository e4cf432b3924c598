//! Gem Hop, a small platformer without any code for playbot, with every verb of it.

mod defects;
mod game;

use std::process::ExitCode;

use EpisodeEnd::Terminated;
use KeyCode::{ArrowLeft, ArrowRight, Space};
use Screen::{Loading, Lost, Playing, Won};
use bevy::prelude::*;
use game::{Hero, Level, Map, Run, Screen};
use playbot::harness::foreign::{ForeignGame, LevelSeed};
use playbot::prelude::EpisodeEnd;

fn main() -> ExitCode {
    playbot::main(&[&defects::add_to(ForeignGame::new("gem_hop", 1, game::game))
        .keys([vec![], vec![ArrowLeft], vec![ArrowRight], vec![ArrowRight, Space], vec![Space]])
        .observe("x y vx vy coyote".split(' ').map(String::from).chain((0..24).map(|i| format!("ahead {i}"))), see)
        .position(|at: Single<&Transform, With<Hero>>| at.translation.truncate())
        .reward_delta(|run: Res<Run>, at: Single<&Transform, With<Hero>>| run.gems as f32 + at.translation.x / 10.0)
        .end(|on: Res<State<Screen>>| matches!(**on, Won | Lost).then(|| Terminated { success: **on == Won }))
        .level(|seed: Res<LevelSeed>, mut level: ResMut<Level>, mut next: ResMut<NextState<Screen>>| {
            level.0 = seed.0;
            next.set(Loading);
        })
        .ready(in_state(Playing))
        .snapshots()
        .snapshot_of(|map: &Map| map.columns.clone(), |map, columns| map.columns.clone_from(columns))
        .demonstrator("runner", |hero: Single<(&Transform, &Hero)>, map: Res<Map>| {
            let (at, next) = (hero.0.translation, map.columns[(hero.0.translation.x + 0.8) as usize]);
            2 + u32::from(next.spikes || f32::from(next.ground) != at.y.floor() || hero.1.velocity.y > 0.0)
        })])
}

/// Returns the hero's position and motion, and the ground, spikes and gems of the next eight columns.
fn see(hero: Single<(&Transform, &Hero)>, map: Res<Map>) -> Vec<f32> {
    let (at, hero) = (hero.0.translation, hero.1);
    let ahead = map.columns.iter().skip(at.x as usize).take(8);
    let ahead = ahead.flat_map(|c| [f32::from(c.ground) - at.y, f32::from(c.spikes), f32::from(c.gem)]);
    [at.x.fract(), at.y, hero.velocity.x, hero.velocity.y, hero.coyote].into_iter().chain(ahead).collect()
}
