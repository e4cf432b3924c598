//! Tests that the first tick of a level finds the same clock and a prepared level, however long it takes to load.

use std::time::Duration;

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::{
    foreign::{ForeignGame, LevelSeed},
    worlds::build_world,
};

/// Frames that the level still takes.
#[derive(Resource)]
struct Left(u32);

/// Returns a game whose level takes this many frames, with fixed steps that take three, and an agent that sees the
/// clocks.
fn slow(frames: u32) -> ForeignGame {
    let game = move |app: &mut App| {
        app.insert_resource(Left(frames))
            .insert_resource(Time::<Fixed>::from_hz(20.0))
            .add_systems(Update, |mut left: ResMut<Left>| left.0 = left.0.saturating_sub(1));
    };
    ForeignGame::new("slow", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["elapsed", "delta", "overstep", "fixed"], |time: Res<Time>, fixed: Res<Time<Fixed>>| {
            [time.elapsed_secs(), time.delta_secs(), fixed.overstep().as_secs_f32(), fixed.elapsed_secs()]
        })
        .time_limit(5)
        .level(move |mut left: ResMut<Left>| left.0 = frames)
        .ready(|left: Res<Left>| left.0 == 0)
}

/// Returns the observations of each tick of two episodes.
fn clocks(frames: u32) -> Vec<Vec<f32>> {
    let (mut world, agents) = build_world(&slow(frames), "default", 0, 0, 1);
    let bot = BlindBot::Constant(ActionValue::Discrete(0));
    world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::list([1, 2])));
    let tick = |_| {
        world.tick().expect("sound");
        world.get::<Observation>(agents[0]).expect("an agent").vector.clone()
    };
    (0..10).map(tick).collect()
}

#[test]
fn the_first_tick_finds_the_same_clock_however_long_the_level_took() {
    let quick = clocks(0);
    let frame = Duration::from_secs_f64(1.0 / 60.0);
    assert_eq!(quick[0], [(2 * frame).as_secs_f32(), frame.as_secs_f32(), frame.as_secs_f32(), 0.0]);
    assert_eq!(quick[..5], quick[5..], "in each episode");
    assert!(quick[4][3] > 0.0, "there are fixed steps");
    for frames in [1, 2, 5, 37] {
        assert_eq!(clocks(frames), quick, "{frames} frames");
    }
}

/// The game's time since the restart.
#[derive(Resource, Default)]
struct Passed(Duration);

/// Returns a game that adds up its time while the level loads, and an agent that sees the sum.
fn adding_up(frames: u32) -> ForeignGame {
    let game = move |app: &mut App| {
        app.insert_resource(Left(frames))
            .init_resource::<Passed>()
            .add_systems(Update, |mut left: ResMut<Left>| left.0 = left.0.saturating_sub(1))
            .add_systems(Update, |time: Res<Time>, mut passed: ResMut<Passed>| passed.0 += time.delta());
    };
    ForeignGame::new("adding", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["passed"], |passed: Res<Passed>| [passed.0.as_secs_f32()])
        .time_limit(3)
        .level(move |mut left: ResMut<Left>, mut passed: ResMut<Passed>| {
            (left.0, passed.0) = (frames, Duration::ZERO);
        })
        .ready(|left: Res<Left>| left.0 == 0)
}

#[test]
fn no_game_time_passes_while_a_level_is_not_ready() {
    let frame = Duration::from_secs_f64(1.0 / 60.0);
    for frames in [0, 1, 5, 37] {
        let (mut world, agents) = build_world(&adding_up(frames), "default", 0, 0, 1);
        let bot = BlindBot::Constant(ActionValue::Discrete(0));
        world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::list([1, 2])));
        for tick in (1..=3).chain(1..=3) {
            world.tick().expect("sound");
            let seen = world.get::<Observation>(agents[0]).expect("an agent").vector[0];
            assert_eq!(seen, ((tick - 1) * frame).as_secs_f32(), "{frames} frames, tick {tick}");
        }
    }
}

#[test]
fn a_level_behind_a_splash_screen_gets_the_clock_in_the_second_half_of_its_frames() {
    let splash = ForeignGame::new("splash", 1, |_: &mut App| {})
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["elapsed"], |time: Res<Time>| [time.elapsed_secs()])
        .time_limit(3)
        .ready(|time: Res<Time>| time.elapsed() > Duration::from_millis(500))
        .ready_within(80);
    let (mut world, agents) = build_world(&splash, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([1])));
    world.tick().expect("40 frames are more than half a second");
    let seen = world.get::<Observation>(agents[0]).expect("an agent").vector[0];
    assert_eq!(seen, (2 * Duration::from_secs_f64(1.0 / 60.0)).as_secs_f32());
}

/// The part of a level that a file brings: it appears some frames after the restart.
#[derive(Component)]
struct Prop;

/// Returns a game whose prop comes after three frames, and an agent that sees where it is.
fn late() -> ForeignGame {
    let bring = |mut left: ResMut<Left>, mut commands: Commands| {
        left.0 = left.0.saturating_sub(1);
        if left.0 == 1 {
            commands.spawn((Prop, Transform::default()));
        }
    };
    let game = move |app: &mut App| {
        app.insert_resource(Left(4)).add_systems(Update, bring);
    };
    ForeignGame::new("late", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["x"], |prop: Single<&Transform, With<Prop>>| [prop.translation.x])
        .time_limit(3)
        .level(|mut left: ResMut<Left>| left.0 = 4)
        .ready(|props: Query<&Prop>| !props.is_empty())
        .loaded(|level: Res<LevelSeed>, mut prop: Single<&mut Transform, With<Prop>>| {
            prop.translation.x += level.0 as f32;
        })
}

#[test]
fn a_part_that_loads_late_is_placed_once_before_the_first_observation() {
    let (mut world, agents) = build_world(&late(), "default", 0, 0, 1);
    let bot = BlindBot::Constant(ActionValue::Discrete(0));
    world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::list([5, 9])));
    let mut tick = || {
        world.tick().expect("sound");
        world.get::<Observation>(agents[0]).expect("an agent").vector[0]
    };
    let seen: Vec<f32> = (0..6).map(|_| tick()).collect();
    assert_eq!(seen, [5.0, 5.0, 5.0, 9.0, 9.0, 9.0]);
}
