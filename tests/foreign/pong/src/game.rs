//! Pong: two paddles and a ball, first to three points, without any code for playbot.
//!
//! All positions are whole numbers, so the game is the same from both sides to the last bit.

use bevy::prelude::*;

/// Points that win a match.
pub const POINTS: u32 = 3;

/// Half of the table: the paddles stand at its ends, and walls are above and below.
pub const HALF: IVec2 = IVec2::new(80, 60);

/// Half of a paddle's length.
const REACH: i32 = 12;

/// Way of a paddle in a frame.
const PACE: i32 = 4;

/// Way of a ball to the side in a frame: after the serve, and at most. Each return adds 1, so that rallies end.
pub const SPEEDS: [i32; 2] = [4, 14];

/// Largest way of a ball up or down in a frame, hit with the end of a paddle.
pub const STEEPEST: i32 = 6;

/// Keys of both players: up and down.
pub const KEYS: [[KeyCode; 2]; 2] = [[KeyCode::KeyW, KeyCode::KeyS], [KeyCode::ArrowUp, KeyCode::ArrowDown]];

/// The match. The left player is 0, the right one 1.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Table {
    pub ball: IVec2,
    /// Way of the ball in a frame.
    pub velocity: IVec2,
    /// Heights of the paddles.
    pub paddles: [i32; 2],
    pub points: [u32; 2],
    /// The number of the match, from which its serves are drawn.
    number: u64,
    serves: u64,
}

impl Table {
    /// Sets up a match. The matches 2n and 2n + 1 have the same serves, to opposite sides.
    pub fn of(number: u64) -> Self {
        let mut table = Self { number, ..Self::default() };
        table.serve();
        table
    }

    /// Returns the match as it is seen in a mirror between the players.
    pub fn mirrored(self) -> Self {
        let [left, right] = self.paddles;
        let flipped = |it: IVec2| IVec2::new(-it.x, it.y);
        Self {
            ball: flipped(self.ball),
            velocity: flipped(self.velocity),
            paddles: [right, left],
            points: [self.points[1], self.points[0]],
            number: self.number ^ 1,
            ..self
        }
    }

    /// Returns the number of the player that has won, if one has.
    pub fn winner(&self) -> Option<usize> {
        self.points.iter().position(|&points| points >= POINTS)
    }

    fn serve(&mut self) {
        let drawn = mixed((self.number / 2).wrapping_mul(1 << 16).wrapping_add(self.serves));
        let within = |bits: u64, most: i32| (bits % (2 * most as u64 + 1)) as i32 - most;
        let is_left = (drawn & 1 == 1) != (self.number % 2 == 1);
        self.serves += 1;
        self.ball = IVec2::new(0, within(drawn >> 8, HALF.y / 2));
        self.velocity = IVec2::new(if is_left { -SPEEDS[0] } else { SPEEDS[0] }, within(drawn >> 32, STEEPEST / 2));
    }

    /// Moves the paddles up (1), down (-1) or not at all, and then the ball.
    pub fn step(&mut self, pushes: [i32; 2]) {
        if self.winner().is_some() {
            return;
        }
        for (height, push) in self.paddles.iter_mut().zip(pushes) {
            *height = (*height + PACE * push).clamp(REACH - HALF.y, HALF.y - REACH);
        }
        self.ball += self.velocity;
        if self.ball.y.abs() > HALF.y {
            self.ball.y = 2 * HALF.y * self.ball.y.signum() - self.ball.y;
            self.velocity.y = -self.velocity.y;
        }
        if self.ball.x.abs() < HALF.x {
            return;
        }
        let player = usize::from(self.ball.x > 0);
        let off = self.ball.y - self.paddles[player];
        if off.abs() > REACH {
            self.points[1 - player] += 1;
            self.serve();
            return;
        }
        let side = self.ball.x.signum();
        self.ball.x = HALF.x * side;
        let speed = (self.velocity.x.abs() + 1).min(SPEEDS[1]);
        self.velocity = IVec2::new(-side * speed, off * STEEPEST / REACH);
    }
}

/// Returns a number whose bits look random (the finaliser of SplitMix64).
fn mixed(number: u64) -> u64 {
    let mut bits = number.wrapping_add(0x9E37_79B9_7F4A_7C15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^ (bits >> 31)
}

/// A paddle in the picture.
#[derive(Component)]
struct Paddle(usize);

/// The ball in the picture.
#[derive(Component)]
struct Ball;

/// The game, as its author wrote it.
pub fn game(app: &mut App) {
    app.insert_resource(Table::of(0)).add_systems(Startup, set_up).add_systems(Update, (play, show).chain());
}

fn set_up(mut commands: Commands) {
    commands.spawn(Camera2d);
    for player in 0..2 {
        let sprite = Sprite::from_color(Color::WHITE, Vec2::new(16.0, 8.0 * REACH as f32));
        commands.spawn((Paddle(player), sprite, Transform::default()));
    }
    commands.spawn((Ball, Sprite::from_color(Color::WHITE, Vec2::splat(16.0)), Transform::default()));
}

fn play(keys: Res<ButtonInput<KeyCode>>, mut table: ResMut<Table>) {
    let pushes = KEYS.map(|pair| {
        let [up, down] = pair.map(|key| i32::from(keys.pressed(key)));
        up - down
    });
    table.step(pushes);
}

fn show(
    table: Res<Table>,
    mut paddles: Query<(&Paddle, &mut Transform)>,
    mut ball: Single<&mut Transform, (With<Ball>, Without<Paddle>)>,
) {
    let pixels = |at: IVec2| (4 * at).as_vec2().extend(0.0);
    for (paddle, mut place) in &mut paddles {
        let x = if paddle.0 == 0 { -HALF.x - 2 } else { HALF.x + 2 };
        place.translation = pixels(IVec2::new(x, table.paddles[paddle.0]));
    }
    ball.translation = pixels(table.ball);
}
