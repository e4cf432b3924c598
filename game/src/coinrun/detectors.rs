//! CoinRun's own detectors, which compare episodes with its rules for hazards, coin, enemies and ground.
//!
//! They apply the rules' own geometry to every tick, for any player.

#[cfg(test)]
mod testing;

use crate::coinrun::{
    CoinRunEnd,
    components::{Arena, ArenaBody, ArenaEntities, Enemy, PlayerBody, PlaysIn, Saw, Tiles},
    level::{Level, Spawn},
    rules::{BLOCK_HALF, Body, motion::touch},
};
use bevy::prelude::*;
use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};
use playbot_harness::{
    detector::{Detector, DetectorTick, EachTick, EpisodeWatcher, LevelAhead},
    prelude::*,
};

/// Returns the detectors of the game.
pub(super) fn detectors() -> Vec<Box<dyn Detector>> {
    vec![
        Box::new(harmless_hazard()),
        Box::new(FarHazard),
        Box::new(goal_ignored()),
        Box::new(StrayEnemy),
        Box::new(inside_ground()),
    ]
}

/// Finds a player that touches the coin in an episode that goes on.
fn goal_ignored() -> impl Detector {
    EachTick::new("goal-ignored", "the coin is touched and the episode goes on", |moment: &DetectorTick<'_>| {
        let is_ignored = goes_on(moment) && touched(moment) == Some(CoinRunEnd::Coin);
        is_ignored.then(|| format!("touches the coin at {}, and the episode goes on", place(moment)))
    })
}

/// Finds a player whose middle is in ground with more ground below it. By the rules a player's corners stay out of
/// walls, and it can be in one only across a ledge one tile thick.
fn inside_ground() -> impl Detector {
    EachTick::new("inside-ground", "a player is inside of ground", |moment: &DetectorTick<'_>| {
        let body = moment.world.get::<PlayerBody>(moment.agent)?.0;
        let arena = moment.world.get::<PlaysIn>(moment.agent)?.0;
        let tiles = &moment.world.get::<Arena>(arena)?.level.tiles;
        let (x, y) = (body.x.floor() as i32, body.y.floor() as i32);
        let is_inside = tiles.get(x, y).is_wall() && tiles.get(x, y - 1).is_wall();
        is_inside.then(|| format!("inside of ground at {}", place(moment)))
    })
}

/// Finds a player that touches a hazard in an episode that goes on.
fn harmless_hazard() -> impl Detector {
    EachTick::new(
        "harmless-hazard",
        "a saw, an enemy or lava is touched and the episode goes on",
        |moment: &DetectorTick<'_>| {
            if !goes_on(moment) {
                return None;
            }
            let what = match touched(moment)? {
                CoinRunEnd::Saw => "a saw",
                CoinRunEnd::Enemy => "an enemy",
                CoinRunEnd::Lava => "lava",
                CoinRunEnd::Coin | CoinRunEnd::LeftMap | CoinRunEnd::Timeout => return None,
            };
            Some(format!("touches {what} at {}, and the episode goes on", place(moment)))
        },
    )
}

/// A player dies away from every hazard.
struct FarHazard;

struct LookingForLethal;

impl Detector for FarHazard {
    fn name(&self) -> &'static str {
        "far-hazard"
    }

    fn describe(&self) -> &'static str {
        "an episode is lost without touching a hazard"
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::new(LookingForLethal))
    }
}

impl EpisodeWatcher for LookingForLethal {
    fn tick(&mut self, _moment: &DetectorTick<'_>) -> Option<String> {
        None
    }

    fn end(&mut self, moment: &DetectorTick<'_>, result: &EpisodeResult) -> Option<String> {
        let is_unfounded = result.end == EpisodeEnd::LOST && touched(moment).is_none_or(CoinRunEnd::is_success);
        is_unfounded.then(|| format!("lost at {} without touching a hazard", place(moment)))
    }
}

// Detector of enemies outside their lanes.

/// Largest allowed distance of an enemy from its lane, tiles: it turns within its own width.
const SLACK: f32 = 0.5;

/// An enemy leaves its row, or the cells between the walls and barriers around its start.
struct StrayEnemy;

/// The lanes of a level, once computed.
#[derive(Default)]
struct Looking(Option<Vec<Lane>>);

/// The lane of an enemy: the middle of its row, and the ends of its free cells.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Lane {
    y: f32,
    left: f32,
    right: f32,
}

impl Detector for StrayEnemy {
    fn name(&self) -> &'static str {
        "stray-enemy"
    }

    fn describe(&self) -> &'static str {
        "an enemy is outside of the row or of the walls between which it started"
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::new(Looking::default()))
    }
}

impl EpisodeWatcher for Looking {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let world = moment.world;
        let arena = world.get::<PlaysIn>(moment.agent)?.0;
        let level = &world.get::<Arena>(arena)?.level;
        let lanes = self.0.get_or_insert_with(|| lanes(level));
        let enemies = world.get::<ArenaEntities>(arena)?.iter().filter(|&entity| world.get::<Enemy>(entity).is_some());
        let mut bodies = enemies.filter_map(|entity| world.get::<ArenaBody>(entity).map(|body| body.0));
        let stray = bodies.find(|body| !lanes.iter().any(|lane| lane.holds(body)))?;
        Some(format!("an enemy is at ({:.1}, {:.1}), outside of every lane of the level", stray.x, stray.y))
    }
}

impl Lane {
    fn holds(&self, body: &Body) -> bool {
        (body.y - self.y).abs() <= SLACK && (self.left - SLACK..=self.right + SLACK).contains(&body.x)
    }
}

fn lanes(level: &Level) -> Vec<Lane> {
    let lane = |spawn: &Spawn| {
        let Spawn::Enemy { cell: [x, y], .. } = *spawn else { return None };
        let turns = |x: &i32| level.tiles.get(*x, y).turns_enemies();
        // Outside of the level is wall.
        let left = (-1..x).rev().find(turns).unwrap_or(-1) + 1;
        let right = (x + 1..).find(turns).unwrap_or(x + 1);
        Some(Lane { y: y as f32 + 0.5, left: left as f32, right: right as f32 })
    };
    level.spawns.iter().filter_map(lane).collect()
}

// Contacts of a player.

/// Returns the contact of the player by the rules, without the clock; `None` too without a player of CoinRun. Saws are
/// those of the level and added ones; every hazard fills a tile, whatever its body.
fn touched(moment: &DetectorTick<'_>) -> Option<CoinRunEnd> {
    let world = moment.world;
    let player = world.get::<PlayerBody>(moment.agent)?.0;
    let arena = world.get::<PlaysIn>(moment.agent)?.0;
    let (level, tiles) = (&world.get::<Arena>(arena)?.level, &world.get::<Tiles>(arena)?.0);
    let (mut saws, mut enemies) = (level.saws_near(player.x).to_vec(), Vec::new());
    for entity in world.get::<ArenaEntities>(arena)?.iter() {
        let Some(body) = world.get::<ArenaBody>(entity) else { continue };
        let body = Body { rx: BLOCK_HALF, ry: BLOCK_HALF, ..body.0 };
        if world.get::<Saw>(entity).is_some() {
            saws.push(body);
        } else if world.get::<Enemy>(entity).is_some() {
            enemies.push(body);
        }
    }
    touch(&player, tiles, &saws, &enemies, 0)
}

/// Returns true if the episode goes on after this tick.
fn goes_on(moment: &DetectorTick<'_>) -> bool {
    let episode = moment.world.get::<Episode>(moment.agent);
    episode.is_some_and(|episode| episode.is_running() && episode.end().is_none())
}

/// Describes the position of the player, for messages.
fn place(moment: &DetectorTick<'_>) -> String {
    let body = moment.world.get::<PlayerBody>(moment.agent).map(|body| body.0).unwrap_or_default();
    format!("({:.1}, {:.1})", body.x, body.y)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::coinrun::detectors::testing::{Bot, findings, first_named, planted, sound};

    #[test]
    fn names_are_different_and_all_are_defaults() {
        let names: BTreeSet<_> = detectors().iter().map(|detector| detector.name()).collect();
        assert_eq!(names.len(), 5);
        assert!(detectors().iter().all(|detector| detector.is_default()));
    }

    #[test]
    fn a_hundred_sound_levels_give_no_finding_whether_they_are_solved_or_not() {
        for bot in [Bot::Search, Bot::Random, Bot::RightJump] {
            for level in 0..100 {
                let found = findings(&sound(), level, bot, 200);
                assert!(found.is_empty(), "level {level}, {bot:?}: {found:?}");
            }
        }
    }

    #[test]
    fn a_coin_that_is_not_taken_is_found_and_one_that_is_taken_is_not() {
        assert!(first_named("goal-ignored", &planted("goal-does-not-end", 0), Bot::RightJump, 0..40).is_some());
        assert_eq!(first_named("goal-ignored", &sound(), Bot::RightJump, 0..40), None);
    }

    #[test]
    fn a_fall_into_ground_that_does_not_hold_is_found_and_a_run_on_ground_is_not() {
        assert!(first_named("inside-ground", &planted("missing-collider", 0), Bot::RightJump, 0..60).is_some());
        assert_eq!(first_named("inside-ground", &sound(), Bot::RightJump, 0..40), None);
    }

    #[test]
    fn a_lane_ends_at_walls_and_barriers() {
        let level = Level::from_text("#....|C\n#A.>..#\n#=====#\n").expect("a valid picture");
        assert_eq!(lanes(&level), [Lane { y: 1.5, left: 1.0, right: 6.0 }]);
        let level = Level::from_text("#..<.|C\n#A....#\n#=====#\n").expect("a valid picture");
        assert_eq!(lanes(&level), [Lane { y: 2.5, left: 1.0, right: 5.0 }]);
    }

    #[test]
    fn enemies_that_rise_or_sink_are_found_and_those_that_walk_are_not() {
        for variant in [0, 3] {
            let planted = planted("stray-enemy", variant);
            assert!(first_named("stray-enemy", &planted, Bot::RightJump, 0..40).is_some(), "{variant}");
        }
        assert_eq!(first_named("stray-enemy", &sound(), Bot::RightJump, 0..40), None);
    }

    #[test]
    fn hazards_that_do_not_kill_are_found_and_those_that_do_are_not() {
        assert!(first_named("harmless-hazard", &planted("harmless-hazard", 0), Bot::RightJump, 0..40).is_some());
        assert_eq!(first_named("harmless-hazard", &sound(), Bot::RightJump, 0..40), None);
    }

    #[test]
    fn deaths_far_from_hazards_are_found_and_others_are_not() {
        for variant in [0, 3] {
            let planted = planted("far-hazard", variant);
            assert!(first_named("far-hazard", &planted, Bot::RightJump, 0..40).is_some(), "{variant}");
        }
        assert_eq!(first_named("far-hazard", &sound(), Bot::RightJump, 0..40), None);
    }
}
