//! A game of catching in `Update`, spawned in `Startup`, with a global score.

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::foreign::{ForeignGame, LevelSeed, Restart};

/// The paddle, at one of the columns 0 to 8.
#[derive(Component)]
pub struct Paddle;

/// A falling apple.
#[derive(Component)]
pub struct Apple {
    /// Rows per second.
    pub speed: f32,
}

/// Apples caught since the program began.
#[derive(Resource, Default)]
pub struct Score(pub u32);

/// A generator with a state of its own.
#[derive(Resource)]
pub struct Orchard(pub u64);

impl Orchard {
    fn column(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % 9) as f32
    }
}

/// The game, as its author wrote it.
pub fn game(app: &mut App) {
    app.init_resource::<Score>()
        .insert_resource(Orchard(1))
        .add_systems(Startup, setup)
        .add_systems(Update, (push, fall, catch).chain());
}

fn setup(mut commands: Commands) {
    commands.spawn((Paddle, Name::new("Paddle"), Transform::from_xyz(4.0, 0.0, 0.0)));
    commands.spawn((Apple { speed: 10.0 }, Transform::from_xyz(4.0, 9.0, 0.0)));
}

fn push(keys: Res<ButtonInput<KeyCode>>, time: Res<Time>, mut paddle: Single<&mut Transform, With<Paddle>>) {
    let right = f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
    let left = f32::from(u8::from(keys.pressed(KeyCode::ArrowLeft)));
    paddle.translation.x = (paddle.translation.x + (right - left) * 12.0 * time.delta_secs()).clamp(0.0, 8.0);
}

fn fall(time: Res<Time>, mut apples: Query<(&Apple, &mut Transform)>) {
    for (apple, mut place) in &mut apples {
        place.translation.y -= apple.speed * time.delta_secs();
    }
}

fn catch(
    mut score: ResMut<Score>,
    mut orchard: ResMut<Orchard>,
    paddle: Single<&Transform, (With<Paddle>, Without<Apple>)>,
    mut apples: Query<&mut Transform, With<Apple>>,
) {
    for mut place in &mut apples {
        let is_at_paddle = (0.0..0.5).contains(&place.translation.y);
        if is_at_paddle && (place.translation.x - paddle.translation.x).abs() < 1.0 {
            score.0 += 1;
            place.translation = Vec3::new(orchard.column(), 9.0, 0.0);
        }
    }
}

/// Returns the game with its adapter.
pub fn catch_game() -> ForeignGame {
    adapted(game)
}

/// Returns the adapter, of the game or of a faulty copy.
pub fn adapted(game: impl Fn(&mut App) + Send + Sync + 'static) -> ForeignGame {
    ForeignGame::new("catch", 1, game)
        .keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]])
        .observe(["paddle", "apple_x", "apple_y"], see)
        .reward_delta(|score: Res<Score>| score.0 as f32)
        .end(|apple: Single<&Transform, With<Apple>>| (apple.translation.y < -1.0).then_some(EpisodeEnd::LOST))
        .time_limit(600)
        .restart(Restart::Startup)
        .level(|level: Res<LevelSeed>, mut orchard: ResMut<Orchard>| orchard.0 = level.0)
        .demonstrator("follower", follow)
}

fn see(
    paddle: Single<&Transform, With<Paddle>>,
    apple: Single<&Transform, (With<Apple>, Without<Paddle>)>,
) -> [f32; 3] {
    [paddle.translation.x / 8.0, apple.translation.x / 8.0, apple.translation.y / 9.0]
}

fn follow(paddle: Single<&Transform, With<Paddle>>, apple: Single<&Transform, (With<Apple>, Without<Paddle>)>) -> u32 {
    match apple.translation.x - paddle.translation.x {
        ahead if ahead > 0.3 => 2,
        ahead if ahead < -0.3 => 1,
        _ => 0,
    }
}
