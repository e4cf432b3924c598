//! A runner on eight levels that were made by hand. Level 4 cannot be finished.

use std::process::ExitCode;

use bevy::prelude::*;
use playbot::prelude::*;

// The game.

/// Start and end of each level's pit, in metres.
pub const PITS: [[f32; 2]; 8] =
    [[3.0, 4.0], [5.0, 6.5], [2.5, 3.5], [6.0, 7.0], [4.0, 7.5], [7.0, 8.0], [3.5, 5.0], [8.0, 9.0]];

#[derive(Component, Default)]
struct Runner {
    x: f32,
    y: f32,
    up: f32,
}

#[derive(Resource, Default)]
pub struct Pit(pub [f32; 2]);

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
        .observe(["x", "y", "from", "to"], |runner: Single<&Runner>, pit: Res<Pit>| {
            [runner.x, runner.y, pit.0[0], pit.0[1]]
        })
        .reward_delta(|runner: Single<&Runner>| runner.x)
        .end(over)
        .time_limit(600)
        .restart(Restart::Startup)
        .levels(8)
        .level(|level: Res<LevelSeed>, mut pit: ResMut<Pit>| pit.0 = PITS[level.0 as usize])
        .position(|runner: Single<&Runner>| Vec2::new(runner.x, runner.y))
        .plan(plan)
        .demonstrator("jumper", |runner: Single<&Runner>, pit: Res<Pit>| {
            1 + u32::from((0.0..0.3).contains(&(pit.0[0] - runner.x)))
        })
}

fn over(runner: Single<&Runner>, pit: Res<Pit>) -> Option<EpisodeEnd> {
    let is_in_pit = runner.y == 0.0 && (pit.0[0]..pit.0[1]).contains(&runner.x);
    (runner.x > 10.0).then_some(EpisodeEnd::WON).or(is_in_pit.then_some(EpisodeEnd::LOST))
}

/// Returns the level from the side: ground left and right of the pit, start and goal.
fn plan(level: u64) -> FloorPlan {
    let [from, to] = PITS[level as usize];
    FloorPlan {
        bounds: Rect::new(-1.0, -1.0, 11.0, 2.0),
        walls: vec![Rect::new(-1.0, -1.0, from, 0.0), Rect::new(to, -1.0, 11.0, 0.0)],
        start: Vec2::ZERO,
        goal: Vec2::new(10.0, 0.0),
        ..FloorPlan::default()
    }
}

fn main() -> ExitCode {
    playbot::main(&[&runner()])
}
