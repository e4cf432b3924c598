//! Tests of levels, as a game's own tests write them, of what physics keeps from one episode to the next, and of tasks
//! beside the frames.

use bevy::{
    log::LogPlugin,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, block_on, poll_once},
};
use foreign_orchard::{Body, FEET, Hero, Level, Map, Screen, game};
use playbot::harness::{
    foreign::{ForeignGame, LevelSeed},
    game::Game,
    worlds::build_world,
};
use playbot::prelude::*;
use std::{
    sync::atomic::{AtomicU32, AtomicUsize, Ordering},
    thread,
    time::Duration,
};

/// Returns the game with the picker, as in `src/main.rs`, and with smaller observations.
fn orchard() -> ForeignGame {
    let (left, right, jump) = (KeyCode::ArrowLeft, KeyCode::ArrowRight, KeyCode::Space);
    ForeignGame::new("orchard", 1, game)
        .hz(64.0)
        .keys([vec![], vec![left], vec![right], vec![right, jump]])
        .clicks(["Play"])
        .observe(["x", "y"], |hero: Option<Single<&Transform, With<Hero>>>| {
            hero.map_or([0.0, 0.0], |at| [at.translation.x, at.translation.y])
        })
        .end(|screen: Res<State<Screen>>| match **screen {
            Screen::Won => Some(EpisodeEnd::WON),
            Screen::Lost => Some(EpisodeEnd::LOST),
            Screen::Menu | Screen::Loading | Screen::Playing => None,
        })
        .time_limit(1500)
        .level(|seed: Res<LevelSeed>, mut level: ResMut<Level>, mut next: ResMut<NextState<Screen>>| {
            level.number = seed.0;
            next.set(Screen::Menu);
        })
        .demonstrator("picker", |hero: Option<Single<Body>>, map: Res<Map>| {
            let Some((at, speed, hero)) = hero.map(Single::into_inner) else { return 4 };
            let (right, jump) = map.hint(at.translation.truncate() - Vec2::Y * FEET, speed.0, hero.coyote > 0.0);
            1 + u32::from(right) + u32::from(jump)
        })
}

/// Plays these levels one after another in one World, and returns the state hashes of each.
fn played(levels: &[u64]) -> Vec<Vec<u64>> {
    let game = orchard();
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::list(levels)));
    game.tools().bots.attach_demonstrator(&mut world, agents[0], 0.0);
    let mut episodes = vec![Vec::new(); levels.len()];
    for _ in 0..1500 * levels.len() {
        let finished = world.get::<EpisodeCount>(agents[0]).expect("an agent").finished as usize;
        let Some(episode) = episodes.get_mut(finished) else { break };
        world.tick().expect("sound");
        episode.push(world.get::<StateHash>(agents[0]).expect("an agent").0);
    }
    episodes
}

#[test]
fn an_episode_is_the_same_after_another_level_and_in_a_new_world() {
    let episodes = played(&[3, 8, 3]);
    assert!(episodes.iter().all(|episode| episode.len() > 300), "each level is played to its gate");
    assert_eq!(episodes[0], episodes[2]);
    assert_eq!(episodes[1], played(&[8])[0]);
    assert_ne!(episodes[0], episodes[1]);
}

#[test]
fn no_world_sets_up_a_log_that_is_there() {
    static LOGS: AtomicU32 = AtomicU32::new(0);
    let counted = ForeignGame::new("counted", 1, |app: &mut App| {
        LOGS.fetch_add(u32::from(app.is_plugin_added::<LogPlugin>()), Ordering::Relaxed);
        game(app);
    });
    let counted = counted.keys([vec![], vec![KeyCode::Space]]).observe(["x"], || [0.0]);
    for _ in 0..3 {
        drop(build_world(&counted, "default", 0, 0, 1));
    }
    assert!(LOGS.load(Ordering::Relaxed) <= 1, "a program has one log");
}

#[test]
fn a_game_may_leave_out_the_log_and_set_up_its_own() {
    #[derive(Resource)]
    struct Added;

    let own = ForeignGame::new("own", 1, |app: &mut App| {
        app.add_plugins(LogPlugin::default()).insert_resource(Added);
    });
    let own = own.keys([vec![], vec![KeyCode::Space]]).observe(["x"], || [0.0]);
    let own = own.headless(|plugins| plugins.build().disable::<LogPlugin>());
    let (world, _) = build_world(&own, "default", 0, 0, 1);
    assert!(world.contains_resource::<Added>());
}

#[test]
fn every_level_can_be_finished() {
    playbot::test(&orchard()).levels("default:0..7").assert_levels_solvable();
}

/// A hero who goes where a task says.
#[derive(Component)]
struct Walker;

#[derive(Component)]
struct Search(Task<f32>);

/// Times that one search after the other takes, in milliseconds, whatever World it belongs to.
const DELAYS: [u64; 7] = [30, 0, 7, 60, 0, 21, 2];

/// Looks for the next place while no search runs.
fn search(walker: Single<&Transform, With<Walker>>, searches: Query<&Search>, mut commands: Commands) {
    static SEARCHES: AtomicUsize = AtomicUsize::new(0);

    if searches.is_empty() {
        let delay = DELAYS[SEARCHES.fetch_add(1, Ordering::Relaxed) % DELAYS.len()];
        let from = walker.translation.x;
        commands.spawn(Search(AsyncComputeTaskPool::get().spawn(async move {
            thread::sleep(Duration::from_millis(delay));
            from + 1.0
        })));
    }
}

/// Goes to the place that a search has found.
fn walk(
    mut walker: Single<&mut Transform, With<Walker>>,
    mut searches: Query<(Entity, &mut Search)>,
    mut commands: Commands,
) {
    for (entity, mut search) in &mut searches {
        if let Some(place) = block_on(poll_once(&mut search.0)) {
            walker.translation.x = place;
            commands.entity(entity).despawn();
        }
    }
}

/// Returns the game of the walker, whose frames wait for its searches.
fn walking() -> ForeignGame {
    let game = |app: &mut App| {
        app.add_systems(Startup, |mut commands: Commands| {
            commands.spawn((Walker, Transform::default()));
        })
        .add_systems(Update, (walk, search).chain());
    };
    ForeignGame::new("walking", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["x"], |walker: Single<&Transform, With<Walker>>| [walker.translation.x])
        .time_limit(20)
        .wait_for_tasks()
}

#[test]
fn a_task_that_is_spawned_in_a_frame_is_done_in_the_next_however_long_it_takes() {
    let game = walking();
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    let idle = BlindBot::Constant(ActionValue::Discrete(0));
    world.entity_mut(agents[0]).insert((Control::Bot, idle, LevelQueue::list([1, 2])));
    let mut places = Vec::new();
    for _ in 0..40 {
        world.tick().expect("sound");
        places.push(world.get::<Observation>(agents[0]).expect("an agent").vector[0]);
    }
    // The frame of the restart begins the first search.
    let episode: Vec<f32> = (0..20).map(|tick| tick as f32).collect();
    assert_eq!(places, [&episode[..], &episode].concat());
    playbot::test(&game).levels("default:0").assert_deterministic();
}
