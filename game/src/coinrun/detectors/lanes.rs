//! Detector of enemies outside their lanes.

use bevy::prelude::*;
use playbot_lab::detector::{Detector, LevelAhead, Moment, Watch};

use crate::coinrun::{
    components::{Arena, ArenaBody, ArenaEntities, Enemy, PlaysIn},
    level::Level,
    rules::Body,
    spawn::Spawn,
};

/// Largest allowed distance of an enemy from its lane, tiles: it turns within its own width.
const SLACK: f32 = 0.5;

/// An enemy leaves its row, or the cells between the walls and barriers around its start.
pub(super) struct StrayEnemy;

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

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn Watch>> {
        Some(Box::new(Looking::default()))
    }
}

impl Watch for Looking {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::detectors::testing::{Bot, first_named, planted, sound};

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
}
