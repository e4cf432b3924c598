//! The adapter of Pong: two seats, what each of them sees, and a scripted rival.

pub mod game;

use bevy::{app::PluginGroupBuilder, diagnostic::FrameCountPlugin, input::InputPlugin, prelude::*, time::TimePlugin};
use game::{HALF, KEYS, POINTS, SPEEDS, STEEPEST, Table};
use playbot::harness::foreign::{ForeignGame, LevelSeed, PlayedAgent, Restart};
use playbot::prelude::EpisodeEnd;

/// Names of the values that each player observes, from its own side.
const SEEN: [&str; 8] = ["own", "other", "ball_x", "ball_y", "ball_vx", "ball_vy", "points", "lost"];

/// Returns the game for playbot.
pub fn pong() -> ForeignGame {
    let held = |[up, down]: [KeyCode; 2]| [vec![], vec![up], vec![down]];
    ForeignGame::new("pong", 1, game::game)
        .hz(30.0)
        // The rules need keys and nothing else of Bevy: all other plugins would take most of the time of a training.
        .headless(|_| {
            let group = PluginGroupBuilder::start::<DefaultPlugins>().add(TaskPoolPlugin::default());
            group.add(FrameCountPlugin).add(TimePlugin).add(InputPlugin)
        })
        .agents(["left", "right"])
        .keys(held(KEYS[0]))
        .keys_of("right", held(KEYS[1]))
        .observe(SEEN, |table: Res<Table>, player: Res<PlayedAgent>| see(&of_left(&table, player.0)))
        .reward_delta(|table: Res<Table>, player: Res<PlayedAgent>| {
            let [won, lost] = of_left(&table, player.0).points;
            won as f32 - lost as f32
        })
        .end(|table: Res<Table>, player: Res<PlayedAgent>| {
            table.winner().map(|winner| EpisodeEnd::Terminated { success: winner == player.0 })
        })
        .time_limit(3000)
        .state_hash(|table: Res<Table>| hash(&table))
        .restart(Restart::system(|| {}))
        .level(|level: Res<LevelSeed>, mut table: ResMut<Table>| *table = Table::of(level.0))
        // No two numbers have the same serves to the same sides.
        .layout(|_, level| level)
        .demonstrator("follower", |table: Res<Table>, player: Res<PlayedAgent>| follow(&of_left(&table, player.0)))
}

/// Returns the match as this player sees it, as if it were the left one.
fn of_left(table: &Table, player: usize) -> Table {
    if player == 0 { *table } else { table.mirrored() }
}

/// Returns what the left player observes, in parts of the table.
fn see(table: &Table) -> [f32; 8] {
    let part = |value: i32, of: i32| value as f32 / of as f32;
    let [own, other] = table.paddles.map(|height| part(height, HALF.y));
    let [points, lost] = table.points.map(|points| points as f32 / POINTS as f32);
    let (ball, velocity) = (table.ball, table.velocity);
    let flight = [part(velocity.x, SPEEDS[1]), part(velocity.y, STEEPEST)];
    [own, other, part(ball.x, HALF.x), part(ball.y, HALF.y), flight[0], flight[1], points, lost]
}

/// Follows the height of the ball with the left paddle, once the ball comes closer and is on its half of the table. Its
/// hand is not steady: within a third of the paddle it lets the ball come.
pub fn follow(table: &Table) -> u32 {
    let off = table.ball.y - table.paddles[0];
    match (table.velocity.x < 0 && table.ball.x < 0, off) {
        (true, 5..) => 1,
        (true, ..=-5) => 2,
        _ => 0,
    }
}

/// Returns a hash of the match.
fn hash(table: &Table) -> u64 {
    let numbers = [table.ball.to_array(), table.velocity.to_array(), table.paddles, table.points.map(|it| it as i32)];
    numbers.as_flattened().iter().fold(7, |hash: u64, number| {
        hash.wrapping_mul(0x0000_0100_0000_01b3).wrapping_add(u64::from(number.cast_unsigned()))
    })
}
