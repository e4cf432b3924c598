//! Bevy's example `breakout`, as it is in the `bevy` package, with every verb of playbot.
//!
//! The example has one level. Here a level is the first direction of the ball.

include!(concat!(env!("OUT_DIR"), "/game.rs"));

use std::process::ExitCode;

use playbot::harness::foreign::{ForeignGame, LevelSeed, Restart};
use playbot::prelude::EpisodeEnd;

fn main() -> ExitCode {
    let breakout = ForeignGame::new("breakout", 1, game)
        .keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]])
        .observe(["x", "y", "vx", "vy", "paddle"], see)
        .reward_delta(|score: Res<Score>| **score as f32)
        .end(|ball: Single<&Transform, With<Ball>>| (ball.translation.y < -250.0).then_some(EpisodeEnd::LOST))
        .time_limit(3840)
        .restart(Restart::Startup)
        .level(aim)
        .demonstrator("follower", |ball: Single<&Transform, With<Ball>>, paddle: Single<&Transform, With<Paddle>>| {
            let off = ball.translation.x - paddle.translation.x;
            u32::from(off < -10.0) + 2 * u32::from(off > 10.0)
        });
    playbot::main(&[&breakout])
}

fn see(ball: Single<(&Transform, &Velocity)>, paddle: Single<&Transform, With<Paddle>>) -> [f32; 5] {
    [ball.0.translation.x, ball.0.translation.y, ball.1.x, ball.1.y, paddle.translation.x].map(|it| it / RIGHT_WALL)
}

/// Resets the ball's first direction, and the score, which the game's own setup leaves.
fn aim(level: Res<LevelSeed>, mut speed: Single<&mut Velocity>, mut score: ResMut<Score>) {
    let slope = (level.0 as f64 * 0.618_034).fract() as f32 * 1.6 - 0.8;
    (***speed, **score) = (Vec2::new(slope, -0.5).normalize() * BALL_SPEED, 0);
}
