//! Tests of snapshots of foreign games: explorers that load them find the same as by replays.

use std::{
    ops::ControlFlow,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
};

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
    let of_pad = Some("snapshots do not hold the state of gamepad buttons".to_owned());
    // A game that declares no snapshots has no obstacle to them.
    for (game, is_saved, obstacle) in [(saving(), true, None), (with_pad, false, of_pad), (strip(), false, None)] {
        let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(0)));
        assert!(SavedEpisode::of(&game, &world, agents[0]).is_none(), "nothing is played yet");
        hashes(&mut world, agents[0], &[2, 2]);
        let saved = SavedEpisode::of(&game, &world, agents[0]);
        assert_eq!(saved.is_some(), is_saved);
        assert_eq!(game.tools().snapshots.obstacle(&world), obstacle);
        let (mut fresh, others) = build_world(&game, "default", 0, 0, 1);
        assert!(!saved.is_some_and(|saved| saved.restore(&game, &mut fresh, others[0])), "no level was built");
    }
}

// All state, saved by the plugin.

/// Numbers, without `Clone` and without reflection.
#[derive(Component, Default)]
struct Legs {
    steps: u32,
}

/// More than numbers, with `Clone` alone.
#[derive(Component, Clone, Default)]
struct Bag(Vec<i32>);

/// Lies on the lane, and goes away once it is taken.
#[derive(Component)]
struct Coin(i32);

/// Appears when a coin is taken, for some ticks.
#[derive(Component)]
struct Spark(u32);

/// Coins that were counted, one tick after they were taken.
#[derive(Resource, Default)]
struct Score(u32);

#[derive(Message)]
struct Taken;

const COINS: [i32; 6] = [3, 7, 11, 15, 19, 23];

fn lane_game(app: &mut App) {
    app.init_resource::<Score>()
        .add_message::<Taken>()
        .add_systems(Startup, begin_lane)
        .add_systems(Update, (count_coins, stride_on, take_coins, burn).chain());
}

fn begin_lane(mut commands: Commands, mut score: ResMut<Score>) {
    score.0 = 0;
    commands.spawn((Walker, Legs::default(), Bag::default(), Transform::default()));
    for place in COINS {
        commands.spawn((Coin(place), Transform::from_xyz(place as f32, 0.0, 0.0)));
    }
}

fn count_coins(mut taken: MessageReader<Taken>, mut score: ResMut<Score>) {
    score.0 += taken.read().count() as u32;
}

/// Each third step is twice as long, and so is each one with an odd number of coins.
fn stride_on(keys: Res<ButtonInput<KeyCode>>, walker: Single<(&mut Transform, &mut Legs, &Bag), With<Walker>>) {
    let (mut at, mut legs, bag) = walker.into_inner();
    if keys.pressed(KeyCode::ArrowRight) {
        legs.steps += 1;
        at.translation.x += if legs.steps % 3 == 0 || bag.0.len() % 2 == 1 { 2.0 } else { 1.0 };
    }
    if keys.pressed(KeyCode::ArrowLeft) {
        at.translation.x -= 1.0;
    }
    if keys.just_pressed(KeyCode::Space) {
        at.translation.y += 1.0;
    }
}

fn take_coins(
    mut commands: Commands,
    walker: Single<(&Transform, &mut Bag), With<Walker>>,
    coins: Query<(Entity, &Coin)>,
    mut taken: MessageWriter<Taken>,
) {
    let (at, mut bag) = walker.into_inner();
    for (entity, coin) in &coins {
        if (at.translation.x - coin.0 as f32).abs() < 1.5 {
            commands.entity(entity).despawn();
            commands.spawn((Spark(3), Transform::from_xyz(coin.0 as f32, 5.0, 0.0)));
            bag.0.push(coin.0);
            taken.write(Taken);
        }
    }
}

/// A spark lifts the walker when it goes out.
fn burn(
    mut commands: Commands,
    mut sparks: Query<(Entity, &mut Spark)>,
    mut walker: Single<&mut Transform, With<Walker>>,
) {
    for (entity, mut spark) in &mut sparks {
        spark.0 -= 1;
        if spark.0 == 0 {
            commands.entity(entity).despawn();
            walker.translation.y += 0.5;
        }
    }
}

/// Returns the game with coins, whose state the plugin saves.
fn lane(plugin: impl Fn(&mut App) + Send + Sync + 'static) -> ForeignGame {
    ForeignGame::new("lane", 1, plugin)
        .keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight], vec![KeyCode::Space]])
        .observe(["x", "score"], |walker: Single<&Transform, With<Walker>>, score: Res<Score>| {
            [walker.translation.x, score.0 as f32]
        })
        .cell(|walker: Single<&Transform, With<Walker>>| {
            [walker.translation.x as i32, (walker.translation.y * 2.0) as i32]
        })
        .reward_delta(|walker: Single<&Transform, With<Walker>>| walker.translation.x)
        .end(|walker: Single<&Transform, With<Walker>>| (walker.translation.x >= 90.0).then_some(EpisodeEnd::WON))
        .time_limit(150)
        .restart(Restart::Startup)
        .forget_messages::<Taken>()
        .snapshots()
}

/// Builds the game, and plays these actions in level 3.
fn played(game: &ForeignGame, actions: &[u32]) -> (World, Entity) {
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    SavedEpisode::prepare(game, &mut world);
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(3)));
    hashes(&mut world, agents[0], actions);
    (world, agents[0])
}

/// Returns the places of all coins, in order, and the number of sparks.
fn coins_and_sparks(world: &mut World) -> (Vec<i32>, usize) {
    let mut coins: Vec<i32> = world.query::<&Coin>().iter(world).map(|coin| coin.0).collect();
    coins.sort_unstable();
    let sparks = world.query::<&Spark>().iter(world).count();
    (coins, sparks)
}

#[test]
fn explorers_find_the_same_from_all_state_as_by_replays() {
    let game = lane(lane_game);
    let (restored, replayed) = (explored(&game, true), explored(&game, false));
    assert_eq!((&restored.snapshot_fault, &restored.snapshot_obstacle), (&None, &None));
    assert!(restored.restored_steps > 100, "{} of {}", restored.restored_steps, restored.steps);
    assert_eq!(everything(&game, &restored), everything(&game, &replayed));
}

#[test]
fn entities_that_are_gone_come_back_and_later_ones_go() {
    let game = lane(lane_game);
    let (mut world, agent) = played(&game, &[0]);
    let saved = SavedEpisode::of(&game, &world, agent).expect("it is saved");
    // At 2 and at 6 the coins at 3 and 7 are taken. The spark of the second one still burns.
    let ahead = [2, 2, 2, 2, 0];
    let expected = hashes(&mut world, agent, &ahead);
    let (coins, sparks) = coins_and_sparks(&mut world);
    assert_eq!((&coins[..], sparks), (&COINS[2..], 1));
    for _ in 0..3 {
        assert!(saved.restore(&game, &mut world, agent));
        assert_eq!(coins_and_sparks(&mut world), (COINS.to_vec(), 0));
        assert_eq!(hashes(&mut world, agent, &ahead), expected);
        assert_eq!(coins_and_sparks(&mut world), (coins.clone(), sparks));
    }
}

#[test]
fn another_world_goes_on_from_all_state() {
    let game = lane(lane_game);
    // Some ticks after a coin, so that its message was read; its spark has burnt.
    let (mut world, agent) = played(&game, &[2, 2, 0, 0, 0, 0, 3, 0]);
    let saved = SavedEpisode::of(&game, &world, agent).expect("it is saved");
    let (left, _) = coins_and_sparks(&mut world);
    assert!(left.len() < COINS.len(), "a coin was taken");
    let ahead = [2, 2, 1, 2, 2, 2, 0, 3, 2];
    let expected = hashes(&mut world, agent, &ahead);
    // One World is ahead, one has just begun.
    for before in [&[2, 2, 2, 2, 2, 2, 2, 2][..], &[1]] {
        let (mut other, agent) = played(&game, before);
        assert!(saved.restore(&game, &mut other, agent));
        assert_eq!(coins_and_sparks(&mut other), (left.clone(), 0));
        assert_eq!(hashes(&mut other, agent, &ahead), expected);
    }
}

#[test]
fn a_tick_with_messages_that_wait_is_not_saved() {
    let game = lane(lane_game);
    let (mut world, agent) = played(&game, &[2]);
    let is_saved = |world: &World| SavedEpisode::of(&game, world, agent).is_some();
    assert!(is_saved(&world));
    // At 2 the coin at 3 is within reach. It is counted in the next tick.
    hashes(&mut world, agent, &[2]);
    assert_eq!(coins_and_sparks(&mut world).0.len(), COINS.len() - 1);
    assert!(!is_saved(&world));
    hashes(&mut world, agent, &[0]);
    assert!(is_saved(&world));
}

/// A diary that only its own function could copy.
#[derive(Resource, Default)]
struct Diary(Vec<f32>);

fn lane_with_diary(app: &mut App) {
    lane_game(app);
    let write = |walker: Single<&Transform, With<Walker>>, mut diary: ResMut<Diary>| diary.0.push(walker.translation.x);
    app.init_resource::<Diary>().add_systems(Update, write.after(burn));
}

#[test]
fn a_type_that_cannot_be_copied_is_named_and_replays_are_used() {
    let game = lane(lane_with_diary);
    let (restored, replayed) = (explored(&game, true), explored(&game, false));
    let obstacle = restored.snapshot_obstacle.as_ref().expect("the diary cannot be copied");
    assert!(obstacle.contains("snapshots::Diary` has changed") && obstacle.contains("`.snapshot_of`"), "{obstacle}");
    assert_eq!((restored.restored_steps, &restored.snapshot_fault), (0, &None));
    assert_eq!(replayed.snapshot_obstacle, None);
    assert_eq!(everything(&game, &restored), everything(&game, &replayed));
}

#[test]
fn a_type_that_the_game_declares_is_copied_by_it() {
    let game =
        lane(lane_with_diary).snapshot_of(|diary: &Diary| diary.0.clone(), |diary, pages| diary.0.clone_from(pages));
    let (mut world, agent) = played(&game, &[2, 1]);
    let saved = SavedEpisode::of(&game, &world, agent).expect("it is saved");
    let pages = world.resource::<Diary>().0.clone();
    hashes(&mut world, agent, &[0, 0]);
    assert_eq!(world.resource::<Diary>().0.len(), pages.len() + 2);
    assert!(saved.restore(&game, &mut world, agent));
    assert_eq!(world.resource::<Diary>().0, pages);
}

/// Counts its copies, and panics at the third one.
#[derive(Resource, Default)]
struct Guarded {
    touched: u32,
    copies: Arc<AtomicU32>,
}

impl Clone for Guarded {
    fn clone(&self) -> Self {
        assert!(self.copies.fetch_add(1, Ordering::Relaxed) < 2, "the third copy breaks");
        Self { touched: self.touched, copies: self.copies.clone() }
    }
}

fn lane_with_guarded(app: &mut App) {
    lane_game(app);
    app.init_resource::<Guarded>().add_systems(Update, |mut guarded: ResMut<Guarded>| guarded.touched += 1);
}

/// Returns how often the resource was copied.
fn copies(world: &World) -> u32 {
    world.resource::<Guarded>().copies.load(Ordering::Relaxed)
}

#[test]
fn nothing_is_copied_in_a_world_that_saves_nothing() {
    let game = lane(lane_with_guarded);
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(3)));
    hashes(&mut world, agents[0], &[2, 1]);
    assert!(SavedEpisode::of(&game, &world, agents[0]).is_none());
    assert_eq!(copies(&world), 0);
    // The start of an episode is copied in a World that is prepared for it.
    let (world, _) = played(&game, &[2, 1]);
    assert_eq!(copies(&world), 1);
}

#[test]
fn a_panic_while_saving_is_named_and_nothing_is_saved_from_then_on() {
    let game = lane(lane_with_guarded);
    let (mut world, agent) = played(&game, &[2]);
    assert!(SavedEpisode::of(&game, &world, agent).is_some());
    for _ in 0..2 {
        assert!(SavedEpisode::of(&game, &world, agent).is_none());
        let obstacle = game.tools().snapshots.obstacle(&world).expect("its `Clone` panics");
        assert!(obstacle.contains("the third copy breaks"), "{obstacle}");
        assert_eq!(copies(&world), 3, "once it has panicked, it is not copied again");
        hashes(&mut world, agent, &[1]);
    }
}
