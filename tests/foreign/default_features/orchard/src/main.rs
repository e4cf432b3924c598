//! Orchard, a platformer without any code for playbot, with every verb of it.

mod defects;
mod rules;

use std::process::ExitCode;

use EpisodeEnd::Terminated;
use KeyCode::{ArrowLeft, ArrowRight, Space};
use Screen::{Lost, Menu, Won};
use bevy::prelude::*;
use foreign_orchard::{ASSETS, Body, FEET, Hero, JUMP_SPEED, Level, Map, RUN_SPEED, Run, Screen, game};
use playbot::harness::foreign::{ForeignGame, LevelSeed};
use playbot::prelude::EpisodeEnd;

fn main() -> ExitCode {
    playbot::main(&[&rules::add_to(ForeignGame::new("orchard", 1, game))
        .hz(64.0)
        .default_plugins(|plugins| plugins.set(AssetPlugin { file_path: ASSETS.into(), ..default() }))
        .keys([vec![], vec![ArrowLeft], vec![ArrowRight], vec![ArrowRight, Space], vec![Space]])
        .clicks(["Play"])
        .observe("menu y vx vy coyote".split(' ').map(String::from).chain((0..16).map(|i| format!("ahead {i}"))), see)
        .position(|at: Single<&Transform, With<Hero>>| at.translation.truncate())
        .reward_delta(|run: Res<Run>| run.fruit as f32 + run.distance / 10.0)
        .end(|on: Res<State<Screen>>| matches!(**on, Won | Lost).then(|| Terminated { success: **on == Won }))
        .end_cause(|on: Res<State<Screen>>, at: Single<&Transform, With<Hero>>| {
            (**on == Lost).then_some(if at.translation.y < 0.0 { "pit" } else { "thorns" })
        })
        .time_limit(1500)
        .level(|seed: Res<LevelSeed>, mut level: ResMut<Level>, mut next: ResMut<NextState<Screen>>| {
            level.number = seed.0;
            next.set(Menu);
        })
        .demonstrator("picker", |hero: Option<Single<Body>>, map: Res<Map>| {
            let Some((at, speed, hero)) = hero.map(Single::into_inner) else { return 5 };
            let (right, jump) = map.hint(at.translation.truncate() - Vec2::Y * FEET, speed.0, hero.coyote > 0.0);
            1 + u32::from(right) + u32::from(jump)
        })])
}

/// Returns the hero's motion, and the height and safety of the ground ahead.
fn see(hero: Option<Single<Body>>, map: Res<Map>) -> Vec<f32> {
    let Some((at, pace, hero)) = hero.map(Single::into_inner) else { return (0..21).map(|i| (i < 1).into()).collect() };
    let ahead = (0..8).map(|i| map.ground(at.translation.x + i as f32 * 0.6));
    let ahead = ahead.flat_map(|(height, is_safe)| [height - at.translation.y, f32::from(is_safe)]);
    [0.0, at.translation.y, pace.x / RUN_SPEED, pace.y / JUMP_SPEED, hero.coyote].into_iter().chain(ahead).collect()
}
