//! Tests of the clocks of foreign games: long frames, slow motion and pauses.

use std::time::Duration;

use bevy::prelude::*;
use bevy_playbot::episode::Tick;
use playbot::prelude::*;
use playbot_harness::{
    foreign::{ForeignGame, Restart},
    worlds::build_world,
};

/// Ticks of an episode.
const TICKS: u32 = 10;

/// Returns a game whose agent sees the clock.
fn timed(game: fn(&mut App)) -> ForeignGame {
    ForeignGame::new("timed", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["elapsed", "delta"], |time: Res<Time>| [time.elapsed_secs(), time.delta_secs()])
        .time_limit(TICKS)
}

/// Returns a World in which a bot is about to play.
fn played(game: &ForeignGame) -> (World, Entity) {
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    let bot = BlindBot::Constant(ActionValue::Discrete(0));
    world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::Always(3)));
    (world, agents[0])
}

/// Returns the observations of each tick of two episodes.
fn two_episodes(game: &ForeignGame) -> [Vec<Vec<f32>>; 2] {
    let (mut world, agent) = played(game);
    [(); 2].map(|()| {
        let tick = |_| {
            world.tick().expect("sound");
            world.get::<Observation>(agent).expect("an agent").vector.clone()
        };
        (0..TICKS).map(tick).collect()
    })
}

/// Sums up the game's time.
#[derive(Resource, Default)]
struct Played(Duration);

fn add_up(app: &mut App) {
    app.init_resource::<Played>().add_systems(Update, |time: Res<Time>, mut played: ResMut<Played>| {
        played.0 += time.delta();
    });
}

#[test]
fn twenty_ticks_at_2_hz_are_ten_seconds() {
    let of_its_own: fn(&mut App) = |app| {
        app.insert_resource(Time::<Virtual>::from_max_delta(Duration::from_millis(100)));
        add_up(app);
    };
    let games: [fn(&mut App); 2] = [add_up, of_its_own];
    for game in games {
        let (mut world, _) = played(&timed(game).time_limit(20).hz(2.0));
        world.ticks(20).expect("sound");
        assert_eq!(world.resource::<Played>().0, Duration::from_secs(10));
    }
}

/// Changes the clock in the fourth tick of an episode.
fn in_the_fourth_tick(change: fn(&mut Time<Virtual>)) -> impl FnMut(ResMut<Time<Virtual>>) {
    move |mut clock: ResMut<Time<Virtual>>| {
        if clock.elapsed() > Duration::from_millis(60) {
            change(&mut clock);
        }
    }
}

#[test]
fn slow_motion_and_pauses_end_with_their_episode() {
    let games: [fn(&mut App); 3] = [
        |app| _ = app.add_systems(Update, in_the_fourth_tick(|clock| clock.set_relative_speed(0.25))),
        |app| _ = app.add_systems(Update, in_the_fourth_tick(|clock| clock.set_relative_speed(0.0))),
        |app| _ = app.add_systems(Update, in_the_fourth_tick(|clock| clock.pause())),
    ];
    for game in games {
        for restart in [Restart::Startup, Restart::system(|| {})] {
            let [first, second] = two_episodes(&timed(game).restart(restart));
            assert!(first[9][1] < first[0][1], "the clock is slower at the end: {first:?}");
            assert_eq!(first, second);
        }
    }
}

#[test]
fn a_speed_that_the_program_begins_with_stays() {
    let games: [fn(&mut App); 2] = [
        |app| app.world_mut().resource_mut::<Time<Virtual>>().set_relative_speed(2.0),
        |app| _ = app.add_systems(Startup, |mut clock: ResMut<Time<Virtual>>| clock.set_relative_speed(2.0)),
    ];
    for game in games {
        for restart in [Restart::Startup, Restart::system(|| {})] {
            let [first, second] = two_episodes(&timed(game).hz(64.0).restart(restart));
            assert_eq!(first[0][1], 1.0 / 32.0);
            assert_eq!(first, second);
        }
    }
}

#[test]
fn a_paused_game_goes_on_where_ticks_are_frames() {
    let menu: fn(&mut App) = |app| _ = app.add_systems(Update, |mut clock: ResMut<Time<Virtual>>| clock.pause());
    let (mut world, agent) = played(&timed(menu));
    for tick in 1..=TICKS {
        world.tick().expect("a pause is part of the game");
        assert_eq!(world.resource::<Tick>().0, u64::from(tick));
    }
    assert_eq!(world.get::<EpisodeCount>(agent).expect("an agent").finished, 1);
}
