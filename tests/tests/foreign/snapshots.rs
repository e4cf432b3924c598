//! Tests of snapshots of foreign games: explorers that load them find the same as by replays.

use std::ops::ControlFlow;

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::{
    foreign::{ForeignGame, Restart},
    saved_episode::SavedEpisode,
    worlds::build_world,
};
use playbot_test::explore::{Exploration, ExplorePlan, Until, explore};

#[derive(Component)]
struct Walker;

/// Steps to the right, of which each third is twice as long.
#[derive(Resource, Clone, Copy, Default)]
struct Stride(u32);

fn game(app: &mut App) {
    app.init_resource::<Stride>().add_systems(Startup, begin).add_systems(Update, walk);
}

fn begin(mut commands: Commands, mut stride: ResMut<Stride>) {
    stride.0 = 0;
    commands.spawn((Walker, Transform::default()));
}

/// Space hops once, however long it is held.
fn walk(keys: Res<ButtonInput<KeyCode>>, mut stride: ResMut<Stride>, mut walker: Single<&mut Transform, With<Walker>>) {
    if keys.pressed(KeyCode::ArrowRight) {
        stride.0 = (stride.0 + 1) % 3;
        walker.translation.x += if stride.0 == 0 { 2.0 } else { 1.0 };
    }
    if keys.pressed(KeyCode::ArrowLeft) {
        walker.translation.x -= 1.0;
    }
    if keys.just_pressed(KeyCode::Space) {
        walker.translation.y += 1.0;
    }
}

/// Returns the game without snapshots.
fn strip() -> ForeignGame {
    ForeignGame::new("strip", 1, game)
        .keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight], vec![KeyCode::Space]])
        .observe(["x"], |walker: Single<&Transform, With<Walker>>| [walker.translation.x])
        .cell(|walker: Single<&Transform, With<Walker>>| [walker.translation.x as i32, walker.translation.y as i32])
        .reward_delta(|walker: Single<&Transform, With<Walker>>| walker.translation.x)
        .end(|walker: Single<&Transform, With<Walker>>| (walker.translation.x >= 90.0).then_some(EpisodeEnd::WON))
        .time_limit(150)
        .restart(Restart::Startup)
}

fn place(world: &mut World, at: Transform) {
    let mut walkers = world.query_filtered::<&mut Transform, With<Walker>>();
    if let Ok(mut walker) = walkers.single_mut(world) {
        *walker = at;
    }
}

/// Returns the game with snapshots of all its state.
fn saving() -> ForeignGame {
    strip().snapshot(
        |walker: Single<&Transform, With<Walker>>, stride: Res<Stride>| (**walker, *stride),
        |world: &mut World, (at, stride): &(Transform, Stride)| {
            place(world, *at);
            world.insert_resource(*stride);
        },
    )
}

/// Returns the game with snapshots that forget the stride.
fn forgetful() -> ForeignGame {
    strip().snapshot(
        |walker: Single<&Transform, With<Walker>>| **walker,
        |world: &mut World, at: &Transform| place(world, *at),
    )
}

fn explored(game: &ForeignGame, snapshots: bool) -> Exploration {
    let plan =
        ExplorePlan { steps: 12_000, until: Until::Spent, threads: 2, snapshots, ..ExplorePlan::new("default", 3) };
    explore(game, &plan, |_| {}, |_| ControlFlow::Continue(())).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns the whole result, with every path.
fn everything(game: &ForeignGame, found: &Exploration) -> String {
    let routes: Vec<_> = found.cells().iter().map(|(cell, reached)| (cell, reached, found.route_to(cell))).collect();
    format!("{:?} {routes:?}", found.summary(game))
}

#[test]
fn explorers_find_the_same_from_snapshots_as_by_replays() {
    let (restored, replayed) = (explored(&saving(), true), explored(&saving(), false));
    assert_eq!((&restored.snapshot_fault, replayed.restored_steps), (&None, 0));
    assert!(restored.restored_steps > 500, "{} of {}", restored.restored_steps, restored.steps);
    assert_eq!(everything(&saving(), &restored), everything(&saving(), &replayed));
}

#[test]
fn a_snapshot_that_forgets_something_is_reported_and_left_out() {
    let (restored, replayed) = (explored(&forgetful(), true), explored(&forgetful(), false));
    let fault = restored.snapshot_fault.as_ref().expect("the stride is forgotten");
    assert_eq!((fault.game, fault.level), ("strip", 3));
    let text = fault.to_string();
    assert!(text.starts_with("the snapshot of `strip` does not restore everything: level 3, tick "), "{text}");
    assert_eq!(restored.restored_steps, 0);
    assert_eq!(everything(&forgetful(), &restored), everything(&forgetful(), &replayed));
}

/// Plays ticks with these actions, and returns the state hash after each.
fn hashes(world: &mut World, agent: Entity, actions: &[u32]) -> Vec<u64> {
    let mut tick = |action: &u32| {
        world.entity_mut(agent).insert(Action(ActionValue::Discrete(*action)));
        world.tick().expect("sound");
        world.get::<StateHash>(agent).expect("an agent").0
    };
    actions.iter().map(&mut tick).collect()
}

#[test]
fn held_keys_go_on_and_keys_of_a_later_tick_are_not_held() {
    let game = saving();
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    let agent = agents[0];
    world.entity_mut(agent).insert((Control::Bot, LevelQueue::Always(3)));
    hashes(&mut world, agent, &[2, 2, 3]);
    let saved = SavedEpisode::of(&game, &world, agent).expect("it is saved");
    // Space stays down, and hops again after another key.
    let ahead = [3, 2, 3, 0, 1, 2, 2];
    let expected = hashes(&mut world, agent, &ahead);
    assert!(saved.restore(&game, &mut world, agent));
    assert_eq!(hashes(&mut world, agent, &ahead), expected);
    // The end of the episode releases what is held, by messages for the next frame.
    while world.get::<EpisodeCount>(agent).is_some_and(|count| count.finished == 0) {
        hashes(&mut world, agent, &[3]);
    }
    assert!(saved.restore(&game, &mut world, agent));
    assert_eq!(hashes(&mut world, agent, &ahead), expected);
}

#[test]
fn games_with_other_inputs_and_worlds_without_a_level_have_no_snapshot() {
    let with_pad = saving().gamepad_buttons([vec![], vec![GamepadButton::South], vec![], vec![]]);
    for (game, is_saved) in [(saving(), true), (with_pad, false), (strip(), false)] {
        let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(0)));
        assert!(SavedEpisode::of(&game, &world, agents[0]).is_none(), "nothing is played yet");
        hashes(&mut world, agents[0], &[2, 2]);
        let saved = SavedEpisode::of(&game, &world, agents[0]);
        assert_eq!(saved.is_some(), is_saved);
        let (mut fresh, others) = build_world(&game, "default", 0, 0, 1);
        assert!(!saved.is_some_and(|saved| saved.restore(&game, &mut fresh, others[0])), "no level was built");
    }
}
