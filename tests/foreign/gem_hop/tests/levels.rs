//! Tests of levels, as a game's own tests write them, and of what physics keeps from one episode to the next.

#[path = "../src/game.rs"]
#[allow(dead_code, reason = "what the adapter reads")]
mod game;

use std::ops::ControlFlow;

use bevy::prelude::*;
use bevy_rapier2d::prelude::CollisionEvent;
use game::{Hero, Level, Map, Run, Screen, game};
use playbot::harness::{
    foreign::{ForeignGame, LevelSeed, Restart},
    game::Game,
    saved_episode::SavedEpisode,
    worlds::build_world,
};
use playbot::prelude::*;
use playbot::test::explore::{ExplorePlan, Until, explore};
use playbot::test::verdict::LevelOutcome;

/// Returns the game with a bot that runs and hops, as in `src/main.rs`, and with smaller observations.
fn gem_hop() -> ForeignGame {
    let (right, hop) = (KeyCode::ArrowRight, KeyCode::Space);
    ForeignGame::new("gem_hop", 1, game)
        .keys([vec![], vec![right], vec![right, hop]])
        .observe(["x", "y"], |hero: Single<&Transform, With<Hero>>| [hero.translation.x, hero.translation.y])
        .end(|screen: Res<State<Screen>>| match **screen {
            Screen::Won => Some(EpisodeEnd::WON),
            Screen::Lost => Some(EpisodeEnd::LOST),
            Screen::Loading | Screen::Playing => None,
        })
        .restart(Restart::Startup)
        .level(|seed: Res<LevelSeed>, mut level: ResMut<Level>, mut next: ResMut<NextState<Screen>>| {
            level.0 = seed.0;
            next.set(Screen::Loading);
        })
        .ready(in_state(Screen::Playing))
        .demonstrator("runner", |hero: Single<(&Transform, &Hero)>, map: Res<Map>| {
            let (at, next) = (hero.0.translation, map.columns[(hero.0.translation.x + 0.8) as usize]);
            1 + u32::from(next.spikes || f32::from(next.ground) != at.y.floor() || hero.1.velocity.y > 0.0)
        })
}

#[test]
fn the_runner_solves_most_levels() {
    let verdicts = playbot::test(&gem_hop()).levels("default:0..7").verdicts().expect("levels");
    let solved: Vec<_> = verdicts.iter().filter(|level| level.outcome == LevelOutcome::Solved).collect();
    assert!(solved.len() >= 5, "{verdicts:?}");
    // A test can name the levels that must stay solvable: here the first of them.
    playbot::test(&gem_hop()).levels(&solved[0].level).assert_levels_solvable();
}

#[test]
fn the_game_plays_the_same_again() {
    playbot::test(&gem_hop()).levels("default:0..1").assert_deterministic();
}

/// Plays these levels one after another in one World, and returns for each tick of each the state hash, and the bits of the
/// hero's position and speed.
fn played(levels: &[u64]) -> Vec<Vec<(u64, [u32; 4])>> {
    let game = gem_hop();
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::list(levels)));
    game.tools().bots.attach_demonstrator(&mut world, agents[0], 0.0);
    let mut heroes = world.query::<(&Transform, &Hero)>();
    let mut episodes = vec![Vec::new(); levels.len()];
    for _ in 0..2000 * levels.len() {
        let finished = world.get::<EpisodeCount>(agents[0]).expect("an agent").finished as usize;
        let Some(episode) = episodes.get_mut(finished) else { break };
        world.tick().expect("sound");
        let moves = heroes.iter(&world).next().map_or([0; 4], |(at, hero)| {
            [at.translation.x, at.translation.y, hero.velocity.x, hero.velocity.y].map(f32::to_bits)
        });
        episode.push((world.get::<StateHash>(agents[0]).expect("an agent").0, moves));
    }
    episodes
}

/// Rapier keeps bodies, contacts and islands, which a restart takes away.
#[test]
fn an_episode_is_the_same_after_another_level_and_in_a_new_world() {
    let episodes = played(&[3, 8, 3]);
    assert!(episodes.iter().all(|episode| episode.len() > 300), "each level is played to its flag");
    assert_eq!(episodes[0], episodes[2]);
    assert_eq!(episodes[1], played(&[8])[0]);
    assert_ne!(episodes[0], episodes[1]);
}

/// Returns the game with snapshots.
fn saving() -> ForeignGame {
    gem_hop()
        .position(|hero: Single<&Transform, With<Hero>>| hero.translation.truncate())
        .snapshots()
        .snapshot_of(|map: &Map| map.columns.clone(), |map, columns| map.columns.clone_from(columns))
}

#[test]
fn explorers_find_the_same_from_snapshots_as_by_replays() {
    let game = saving();
    let explored = |snapshots: bool| {
        let plan = ExplorePlan { steps: 20_000, until: Until::Spent, snapshots, ..ExplorePlan::new("default", 3) };
        let found = explore(&game, &plan, |_| {}, |_| ControlFlow::Continue(()));
        found.unwrap_or_else(|error| panic!("{error}"))
    };
    let (restored, replayed) = (explored(true), explored(false));
    assert_eq!((&restored.snapshot_fault, &restored.snapshot_obstacle), (&None, &None));
    assert!(restored.restored_steps > 0, "of {}", restored.steps);
    assert_eq!(format!("{:?}", restored.summary(&game)), format!("{:?}", replayed.summary(&game)));
}

/// Rapier's messages are not in Bevy's registry of messages.
#[test]
fn a_gem_that_was_touched_before_a_load_is_not_taken_after_it() {
    let game = saving();
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    SavedEpisode::prepare(&game, &mut world);
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(3)));
    game.tools().bots.attach_demonstrator(&mut world, agents[0], 0.0);
    let (mut saved, mut touched) = (None, 0);
    for _ in 0..1000 {
        world.tick().expect("sound");
        saved = saved.or_else(|| SavedEpisode::of(&game, &world, agents[0]));
        touched = world.resource::<Messages<CollisionEvent>>().len();
        if touched > 0 {
            break;
        }
    }
    let saved = saved.expect("no message waits before the first gem");
    assert!(touched > 0 && world.resource::<Run>().gems == 0, "the game reads of it in the next tick");
    assert!(saved.restore(&game, &mut world, agents[0]));
    world.tick().expect("sound");
    assert_eq!(
        (world.resource::<Run>().gems, saved.tick() + 1),
        (0, world.get::<Episode>(agents[0]).expect("one").tick)
    );
}
