//! A runner that must reach the flag without stepping into the pit.

use std::process::ExitCode;

use bevy::prelude::*;
use playbot::prelude::*;

// The game.

#[derive(Component, Default)]
struct Runner {
    x: f32,
    y: f32,
    up: f32,
}

#[derive(Resource, Default)]
struct Pit(f32);

fn game(app: &mut App) {
    app.init_resource::<Pit>().add_systems(Startup, enter).add_systems(Update, run);
}

fn enter(mut commands: Commands) {
    commands.spawn(Runner::default());
}

fn run(keys: Res<ButtonInput<KeyCode>>, time: Res<Time>, mut runner: Single<&mut Runner>) {
    let dt = time.delta_secs();
    if keys.pressed(KeyCode::ArrowRight) {
        runner.x += 3.0 * dt;
    }
    if keys.pressed(KeyCode::Space) && runner.y == 0.0 {
        runner.up = 4.0;
    }
    runner.up -= 9.8 * dt;
    runner.y += runner.up * dt;
    if runner.y <= 0.0 {
        (runner.y, runner.up) = (0.0, 0.0);
    }
}

// Its adapter for testers.

pub fn runner() -> ForeignGame {
    ForeignGame::new("runner", 1, game)
        .keys([vec![], vec![KeyCode::ArrowRight], vec![KeyCode::ArrowRight, KeyCode::Space]])
        .observe(["y", "up", "pit", "flag"], |runner: Single<&Runner>, pit: Res<Pit>| {
            [runner.y, runner.up / 5.0, (pit.0 - runner.x) / 5.0, (10.0 - runner.x) / 10.0]
        })
        .reward_delta(|runner: Single<&Runner>| runner.x)
        .end(over)
        .time_limit(600)
        .restart(Restart::Startup)
        .level(|level: Res<LevelSeed>, mut pit: ResMut<Pit>| {
            pit.0 = 2.0 + 6.0 * (level.0 as f64 * 0.618_034).fract() as f32;
        })
        .demonstrator("jumper", |runner: Single<&Runner>, pit: Res<Pit>| {
            1 + u32::from((0.0..1.0).contains(&(pit.0 - runner.x)))
        })
}

fn over(runner: Single<&Runner>, pit: Res<Pit>) -> Option<EpisodeEnd> {
    let is_in_pit = runner.y == 0.0 && (runner.x - pit.0).abs() < 0.5;
    (runner.x > 10.0).then_some(EpisodeEnd::WON).or(is_in_pit.then_some(EpisodeEnd::LOST))
}

fn main() -> ExitCode {
    playbot::main(&[&runner()])
}
