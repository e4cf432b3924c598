//! Three rooms: a game of states, whose level takes a few frames to load, with physics in `FixedUpdate` at its own
//! rate.

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::foreign::{ForeignGame, LevelSeed, Restart};

/// State of the game.
#[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Stage {
    /// A menu that waits for input.
    #[default]
    Menu,
    /// A level is being loaded: seven frames.
    Loading,
    /// A level is being played.
    Playing,
    /// Lost.
    Over,
}

/// The walker, at 20 steps a second.
#[derive(Component, Default)]
pub struct Walker {
    /// Steps walked, either way.
    pub steps: i32,
}

/// Frames that the level still takes.
#[derive(Resource, Default)]
pub struct LoadingFrames(pub u32);

/// Frames of play in `Update`, of this program.
#[derive(Resource, Default)]
pub struct PlayedFrames(pub u64);

/// The game, as its author wrote it.
pub fn game(app: &mut App) {
    app.init_state::<Stage>()
        .init_resource::<LoadingFrames>()
        .init_resource::<PlayedFrames>()
        .insert_resource(Time::<Fixed>::from_hz(20.0))
        .add_systems(OnEnter(Stage::Loading), |mut frames: ResMut<LoadingFrames>| frames.0 = 7)
        .add_systems(OnEnter(Stage::Playing), |mut commands: Commands| {
            commands.spawn((DespawnOnExit(Stage::Playing), Walker::default(), Transform::default()));
        })
        .add_systems(Update, load.run_if(in_state(Stage::Loading)))
        .add_systems(Update, (|mut frames: ResMut<PlayedFrames>| frames.0 += 1).run_if(in_state(Stage::Playing)))
        .add_systems(FixedUpdate, walk.run_if(in_state(Stage::Playing)));
}

fn load(mut frames: ResMut<LoadingFrames>, mut next: ResMut<NextState<Stage>>) {
    frames.0 -= 1;
    if frames.0 == 0 {
        next.set(Stage::Playing);
    }
}

fn walk(
    keys: Res<ButtonInput<KeyCode>>,
    mut walker: Single<(&mut Walker, &mut Transform)>,
    mut next: ResMut<NextState<Stage>>,
) {
    let (walker, place) = &mut *walker;
    let forward = if keys.pressed(KeyCode::KeyD) { 1 } else { -1 };
    walker.steps += 1;
    place.translation.x += forward as f32;
    if place.translation.x <= -3.0 {
        next.set(Stage::Over);
    }
}

/// Returns the adapter.
pub fn rooms_game() -> ForeignGame {
    ForeignGame::new("rooms", 1, game)
        .keys([vec![], vec![KeyCode::KeyD]])
        .observe(["x"], |walker: Single<&Transform, With<Walker>>| [walker.translation.x])
        .reward_delta(|walker: Single<&Transform, With<Walker>>| walker.translation.x)
        .end(is_over)
        .restart(Restart::state(Stage::Loading))
        .ready(|stage: Res<State<Stage>>| *stage == Stage::Playing)
        .hz(60.0)
}

fn is_over(
    stage: Res<State<Stage>>,
    next: Res<NextState<Stage>>,
    walkers: Query<&Transform, With<Walker>>,
    _level: Res<LevelSeed>,
) -> Option<EpisodeEnd> {
    let is_lost = *stage == Stage::Over || matches!(*next, NextState::Pending(Stage::Over));
    let is_won = walkers.iter().any(|place| place.translation.x >= 3.0);
    is_lost.then_some(EpisodeEnd::LOST).or(is_won.then_some(EpisodeEnd::WON))
}
