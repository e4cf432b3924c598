//! Tests of agents that leap over cells between two ticks.

use std::ops::ControlFlow;

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::{
    floor_plan::FloorPlan,
    game::{LevelTools, StateTools},
};
use playbot_test::explore::{ExploreError, ExplorePlan, ExploredCell, Stop, Until, explore, round::check_cell};
use playbot_tests::{Cell, as_corridor, corridor_plugin};

/// The corridor, whose cells are two squares apart: every other one of its 13 squares is only passed.
struct Leaps;

impl Game for Leaps {
    as_corridor!(but build);

    fn build(&self, app: &mut App, _mode: &str) {
        corridor_plugin(app);
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools { levels: self, state: self, ..GameTools::default() }
    }
}

impl LevelTools for Leaps {
    fn floor_plan(&self, _mode: &str, _level: u64) -> Option<FloorPlan> {
        Some(FloorPlan {
            bounds: Rect::new(0.0, 0.0, 13.0, 2.0),
            walls: vec![Rect::new(0.0, 1.0, 13.0, 2.0)],
            start: Vec2::new(6.5, 0.5),
            goal: Vec2::new(12.5, 0.5),
            ..FloorPlan::default()
        })
    }
}

impl StateTools for Leaps {
    fn position(&self, world: &World, agent: Entity) -> Option<Vec2> {
        world.get::<Cell>(agent).map(|cell| Vec2::new(2.0 * cell.0 as f32 + 0.5, 0.5))
    }
}

fn plan() -> ExplorePlan {
    ExplorePlan { steps: 5000, until: Until::Spent, threads: 2, ..ExplorePlan::new("plain", 1) }
}

#[test]
fn cells_that_are_passed_between_two_ticks_are_reached() {
    let explored = |plan: &ExplorePlan| explore(&Leaps, plan, |_| {}, |_| ControlFlow::Continue(()));
    let found = explored(&plan()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((found.coverage(), found.open_reached(), found.stop), (Some(1.0), Some(13), Stop::Spent));
    for (cell, reached) in found.cells() {
        assert_eq!(reached.is_passed, cell.0[0] % 2 == 1, "{cell}");
        let way = found.route_to(cell).expect("reached");
        assert_eq!(way.len(), reached.ticks() as usize, "{cell}");
    }
    let few = ExplorePlan { threads: 1, arenas: 3, worlds: 1, ..plan() };
    let again = explored(&few).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(again.cells(), found.cells(), "threads and arenas change nothing");
}

#[test]
fn cells_that_the_level_cannot_have_are_refused() {
    let check = |text: &str| check_cell(&Leaps, &plan(), &text.parse::<ExploredCell>().expect("a cell"));
    assert!(check("12,0").is_ok());
    for (text, words) in [
        ("90,0", "go from 0,0 to 12,1"),
        ("3", "cells of this level have 2, such as"),
        ("1,2,3", "cells of this level have 2"),
    ] {
        match check(text) {
            Err(ExploreError::Plan(why)) => assert!(why.contains(words), "{why}"),
            other => panic!("{text}: {other:?}"),
        }
    }
}
