//! A ball in the wind, with a memory: a game whose later episodes do not begin like the first one.

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::foreign::{ForeignGame, LevelSeed, Restart};

/// The ball, on a line.
#[derive(Component)]
pub struct Ball;

/// Gusts since the program began, never reset.
#[derive(Resource, Default)]
pub struct Gusts(pub u32);

/// The level that the systems of `Startup` have found.
#[derive(Resource, Debug, PartialEq, Eq)]
pub struct Planted(pub u64);

/// The game, as its author wrote it.
pub fn game(app: &mut App) {
    app.init_resource::<Gusts>().add_systems(Startup, setup).add_systems(Update, (roll, blow).chain());
}

fn setup(level: Res<LevelSeed>, mut commands: Commands) {
    commands.spawn((Ball, Transform::default()));
    commands.insert_resource(Planted(level.0));
}

fn roll(keys: Res<ButtonInput<KeyCode>>, mut ball: Single<&mut Transform, With<Ball>>) {
    let right = f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
    let left = f32::from(u8::from(keys.pressed(KeyCode::ArrowLeft)));
    ball.translation.x += 0.3 * (right - left);
}

/// Brings a gust in every fifth frame of the program, each of another strength.
fn blow(mut frames: Local<u32>, mut gusts: ResMut<Gusts>, mut ball: Single<&mut Transform, With<Ball>>) {
    *frames += 1;
    if frames.is_multiple_of(5) {
        gusts.0 += 1;
        ball.translation.x += 0.01 * (gusts.0 % 13) as f32;
    }
}

/// Returns the adapter: ball and level begin anew, frames and gusts only if the World does.
pub fn stubborn_game(restart: Restart) -> ForeignGame {
    ForeignGame::new("stubborn", 1, game)
        .keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]])
        .observe(["x"], |ball: Single<&Transform, With<Ball>>| [ball.translation.x])
        .reward_delta(|ball: Single<&Transform, With<Ball>>| ball.translation.x)
        .end(|ball: Single<&Transform, With<Ball>>| (ball.translation.x >= 2.0).then_some(EpisodeEnd::WON))
        .time_limit(20)
        .restart(restart)
        .level(|level: Res<LevelSeed>, mut ball: Single<&mut Transform, With<Ball>>| {
            ball.translation.x = 0.1 * (level.0 % 4) as f32;
        })
        .demonstrator(
            "sometimes",
            |ball: Single<&Transform, With<Ball>>| {
                if ball.translation.x < 0.7 { 2_u32 } else { 0 }
            },
        )
}
