//! Moments for tests.

use bevy::prelude::*;
use bevy_playbot::action::ActionValue;

use crate::{
    detector::{Detector, LevelAhead, Moment, WorldMoment},
    floor_plan::FloorPlan,
};

/// What happens in a tick.
#[derive(Clone, Debug)]
pub struct Step {
    pub place: Option<Vec2>,
    pub action: u32,
    pub seen: f32,
    pub reward: f32,
    pub is_success: bool,
}

impl Step {
    /// An agent at this place; the number of the tick is its action.
    pub fn at(tick: usize, x: f32, y: f32) -> Self {
        let action = tick as u32 % 3;
        Self { place: Some(Vec2::new(x, y)), action, seen: 0.5, reward: 0.0, is_success: false }
    }
}

/// A level of ten tiles by ten, with walls around it, its start at the lower left and its goal at the upper right.
pub fn room() -> LevelAhead {
    let square = |row: usize, column: usize| {
        let corner = Vec2::new(column as f32, row as f32);
        Rect::from_corners(corner, corner + 1.0)
    };
    let is_wall = |row: usize, column: usize| row.is_multiple_of(9) || column.is_multiple_of(9);
    let plan = FloorPlan::of_tiles([10, 10], is_wall, square, [Vec2::splat(1.5), Vec2::splat(8.5)]);
    LevelAhead { level: 0, plan: Some(plan) }
}

/// What a detector says of an episode on a level, and in which tick.
pub fn found(detector: &dyn Detector, level: &LevelAhead, steps: &[Step]) -> Option<(u32, String)> {
    let mut world = World::new();
    let agent = world.spawn_empty().id();
    let mut watch = detector.watch(level)?;
    (0..).zip(steps).find_map(|(tick, step)| {
        let action = ActionValue::Discrete(step.action);
        let observation = [step.seen];
        let moment = Moment {
            world: &world,
            agent,
            level: level.level,
            tick,
            action: &action,
            observation: &observation,
            state_hash: 0,
            reward: step.reward,
            place: step.place,
            is_success: step.is_success,
        };
        watch.tick(&moment).map(|message| (tick, message))
    })
}

/// What a detector says of a World.
pub fn found_in(detector: &dyn Detector, world: &World) -> Option<String> {
    detector.watch_world()?.tick(&WorldMoment { world, errors: &[] })
}
