//! A game of two paddles and one ball, for two agents that play against each other.

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::foreign::{ForeignGame, LevelSeed, PlayedAgent, Restart};

/// A paddle, at a height from -4 to 4.
#[derive(Component)]
pub struct Paddle {
    /// 0 on the left, 1 on the right.
    pub side: usize,
    up: KeyCode,
    down: KeyCode,
}

/// The ball, with its velocity in units per frame.
#[derive(Component)]
pub struct Ball(pub Vec2);

/// The side that has lost the ball.
#[derive(Resource, Default)]
pub struct Loser(pub Option<usize>);

/// The game, as its author wrote it.
pub fn game(app: &mut App) {
    app.init_resource::<Loser>().add_systems(Startup, setup).add_systems(Update, (push, fly).chain());
}

fn setup(mut commands: Commands) {
    let keys = [(KeyCode::KeyW, KeyCode::KeyS), (KeyCode::ArrowUp, KeyCode::ArrowDown)];
    for (side, (up, down)) in keys.into_iter().enumerate() {
        let x = if side == 0 { -8.0 } else { 8.0 };
        commands.spawn((Paddle { side, up, down }, Transform::from_xyz(x, 0.0, 0.0)));
    }
    commands.spawn((Ball(Vec2::new(0.5, 0.0)), Transform::default()));
}

fn push(keys: Res<ButtonInput<KeyCode>>, mut paddles: Query<(&Paddle, &mut Transform)>) {
    for (paddle, mut place) in &mut paddles {
        let [up, down] = [paddle.up, paddle.down].map(|key| f32::from(u8::from(keys.pressed(key))));
        place.translation.y = (place.translation.y + 0.5 * (up - down)).clamp(-4.0, 4.0);
    }
}

fn fly(
    ball: Single<(&mut Ball, &mut Transform), Without<Paddle>>,
    paddles: Query<(&Paddle, &Transform), Without<Ball>>,
    mut loser: ResMut<Loser>,
) {
    let (mut ball, mut place) = ball.into_inner();
    place.translation += ball.0.extend(0.0);
    if place.translation.y.abs() >= 4.0 {
        ball.0.y = -ball.0.y;
    }
    for (paddle, at) in &paddles {
        let away = if paddle.side == 0 { -place.translation.x } else { place.translation.x };
        if away >= 8.0 {
            if (place.translation.y - at.translation.y).abs() > 1.0 {
                loser.0 = Some(paddle.side);
            }
            ball.0.x = -ball.0.x;
        }
    }
}

/// The names of the values that each agent observes.
const SEEN: [&str; 5] = ["own", "other", "ball_away", "ball_height", "level"];

/// Returns the game with its adapter.
pub fn pong_game() -> ForeignGame {
    ForeignGame::new("pong", 1, game)
        .agents(["left", "right"])
        .keys([vec![], vec![KeyCode::KeyW], vec![KeyCode::KeyS]])
        .keys_of("right", [vec![], vec![KeyCode::ArrowUp], vec![KeyCode::ArrowDown]])
        .observe(SEEN, see)
        .reward(|loser: Res<Loser>, agent: Res<PlayedAgent>| match loser.0 {
            Some(side) if side == agent.0 => -1.0,
            Some(_) => 1.0,
            None => 0.0,
        })
        .end(|loser: Res<Loser>, agent: Res<PlayedAgent>| {
            loser.0.map(|side| if side == agent.0 { EpisodeEnd::LOST } else { EpisodeEnd::WON })
        })
        .time_limit(200)
        .restart(Restart::Startup)
        .level(serve)
}

/// Serves the ball to the left on even levels, and to the right on odd ones, ever steeper.
fn serve(level: Res<LevelSeed>, mut loser: ResMut<Loser>, mut ball: Single<&mut Ball>) {
    loser.0 = None;
    let aside = if level.0.is_multiple_of(2) { -0.5 } else { 0.5 };
    ball.0 = Vec2::new(aside, 0.125 * (level.0 % 4) as f32);
}

/// Returns the game from the agent's own side: the same numbers for both, if they are in the same situation.
fn see(
    agent: Res<PlayedAgent>,
    level: Res<LevelSeed>,
    paddles: Query<(&Paddle, &Transform)>,
    ball: Single<&Transform, With<Ball>>,
) -> [f32; 5] {
    let height =
        |side: usize| paddles.iter().find(|(paddle, _)| paddle.side == side).map_or(0.0, |(_, at)| at.translation.y);
    let away = if agent.0 == 0 { ball.translation.x + 8.0 } else { 8.0 - ball.translation.x };
    [height(agent.0), height(1 - agent.0), away, ball.translation.y, level.0 as f32]
}
