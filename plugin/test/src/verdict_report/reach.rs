//! The squares of a level that were reached, and the wall of those that were not.

use crate::{
    explore::{CellGrid, Exploration, ExplorePlan, ExploredCell, Until, explore_until, open_cells},
    verdict::LevelMaps,
    verdict_report::heat::{Grid, path, shape, stacked},
};
use bevy::math::{Rect, Vec2};
use playbot_harness::{floor_plan::FloorPlan, game::Game};
use playbot_report::counted;
use std::{collections::BTreeSet, fmt::Write, ops::ControlFlow};

/// Pattern of lines over squares that were not reached, which no colour of a level has. A page has it once.
pub(crate) const HATCH: &str = "<defs><pattern id=\"hatch\" width=\"12\" height=\"12\" patternUnits=\"userSpaceOnUse\">\
     <path class=\"hatch\" d=\"M-3 3l6-6M0 12L12 0M9 15l6-6\"/></pattern></defs>";

/// Squares along each side that become one if a drawing would be too large.
const STEPS: [i32; 5] = [1, 2, 4, 8, 16];

/// Most environment steps of an explorer on a level.
const MOST_STEPS: u64 = 20_000;

/// Explorer of the levels of a page that are proved unsolvable.
#[derive(Clone, Copy)]
pub struct LevelExplorer<'a> {
    /// Threads. They change no result.
    pub threads: usize,
    /// Called for each explored level.
    pub each: &'a dyn Fn(),
    /// Returns whether to stop; later levels have the squares of the testers alone.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

impl LevelExplorer<'_> {
    /// Explores a level with at most so many steps, and takes those that were used away. `None` if no step is left, the
    /// level cannot be explored, or `stop` returned true.
    pub(super) fn explore(&self, game: &dyn Game, mode: &str, level: u64, left: &mut u64) -> Option<Exploration> {
        let steps = MOST_STEPS.min(*left);
        if steps == 0 || (self.stop)() {
            return None;
        }
        (self.each)();
        let plan = ExplorePlan {
            steps,
            until: Until::Covered,
            threads: self.threads,
            keeps_panics: false,
            ..ExplorePlan::new(mode, level)
        };
        let explored = explore_until(game, &plan, |_| {}, |_| ControlFlow::Continue(()), self.stop);
        // The last round may take more, and a level that cannot be explored costs nothing that is known.
        *left = left.saturating_sub(explored.as_ref().map_or(steps, |explored| explored.steps.max(1)));
        explored.ok().filter(|_| !(self.stop)())
    }
}

/// The squares that were reached, and those around the start and around the goal that were not.
pub(crate) struct Reached {
    grid: CellGrid,
    /// Column and row of each.
    reached: BTreeSet<[i32; 2]>,
    missed: BTreeSet<[i32; 2]>,
    is_explored: bool,
}

impl Reached {
    /// Returns the squares of an exploration; `None` for cells that are no squares.
    pub fn of(explored: &Exploration, floor: &FloorPlan) -> Option<Self> {
        let grid = explored.grid?;
        let reached: BTreeSet<[i32; 2]> = explored.cells().keys().filter_map(square).collect();
        let from_start = explored.open.iter().flatten().filter_map(square);
        let missed = from_start.chain(around_goal(floor, &grid)).filter(|square| !reached.contains(square)).collect();
        Some(Self { grid, reached, missed, is_explored: true })
    }

    /// Returns the squares that testers visited; `None` without open squares.
    pub fn by_testers(maps: &LevelMaps, floor: &FloorPlan) -> Option<Self> {
        let grid = CellGrid { origin: Vec2::new(maps.x, maps.y), size: maps.side };
        // A file may hold any number.
        let open = if maps.side.is_finite() && maps.side > 0.0 { open_cells(floor, &grid)? } else { return None };
        let reached = visited(maps);
        let all = open.iter().filter_map(square).chain(around_goal(floor, &grid));
        let missed = all.filter(|square| !reached.contains(square)).collect();
        Some(Self { grid, reached, missed, is_explored: false })
    }

    /// Adds the squares that testers visited. Those of a large level are several cells wide.
    pub fn with_testers(mut self, maps: &LevelMaps) -> Self {
        let squares = CellGrid { origin: Vec2::new(maps.x, maps.y), size: maps.side };
        let visited = visited(maps);
        let is_visited = |cell: &[i32; 2]| {
            let middle = self.grid.origin + (Vec2::new(cell[0] as f32, cell[1] as f32) + 0.5) * self.grid.size;
            squares.cell_at(middle).as_ref().and_then(square).is_some_and(|square| visited.contains(&square))
        };
        let (known, missed) = self.missed.iter().partition::<BTreeSet<_>, _>(|cell| is_visited(cell));
        self.reached.extend(known);
        self.missed = missed;
        self
    }

    /// Returns the share of the squares that were reached, among those that no wall cuts off from the start or the goal.
    pub fn share(&self) -> f64 {
        self.reached.len() as f64 / (self.reached.len() + self.missed.len()).max(1) as f64
    }

    /// Describes the squares that were not reached, without a full stop.
    pub fn words(&self) -> String {
        let who = if self.is_explored { "Neither a tester nor an explorer" } else { "No tester" };
        match self.missed.len() {
            0 => "Every square that no wall cuts off from the start or from the goal was reached".to_owned(),
            missed => format!("{who} reached {}, which the picture has hatched", counted(missed as u64, "open square")),
        }
    }

    /// Draws the squares in the finest form with at most so many bytes; empty if even the coarsest has more.
    pub fn svg(&self, grid: &Grid, most: usize) -> String {
        STEPS.iter().map(|step| self.drawn(grid, *step)).find(|svg| svg.len() <= most).unwrap_or_default()
    }

    fn drawn(&self, grid: &Grid, step: i32) -> String {
        let coarse = |squares: &BTreeSet<[i32; 2]>| {
            squares.iter().map(|square| square.map(|number| number.div_euclid(step))).collect::<BTreeSet<_>>()
        };
        let reached = coarse(&self.reached);
        let missed = coarse(&self.missed);
        let side = self.grid.size * step as f32;
        let outline = |squares: &mut dyn Iterator<Item = &[i32; 2]>| {
            let areas = squares.filter_map(|[column, row]| {
                let corner = self.grid.origin + Vec2::new(*column as f32, *row as f32) * side;
                let area = Rect::from_corners(corner, corner + side);
                if area.min.is_finite() && area.max.is_finite() { grid.block(area) } else { None }
            });
            path(&stacked(areas.collect()))
        };
        let mut svg = String::new();
        shape("reached", None, &outline(&mut reached.iter()), &mut svg);
        let missed = outline(&mut missed.difference(&reached));
        shape("missed", None, &missed, &mut svg);
        if !missed.is_empty() {
            let _ = write!(svg, "<path class=\"hatched\" fill=\"url(#hatch)\" d=\"{missed}\"/>");
        }
        svg
    }
}

/// Returns column and row of a cell that is a square.
fn square(cell: &ExploredCell) -> Option<[i32; 2]> {
    cell.0.as_slice().try_into().ok()
}

/// Returns the squares that walls do not cut off from the goal.
fn around_goal(floor: &FloorPlan, grid: &CellGrid) -> Vec<[i32; 2]> {
    let from_goal = open_cells(&FloorPlan { start: floor.goal, ..floor.clone() }, grid).unwrap_or_default();
    from_goal.iter().filter_map(square).collect()
}

fn visited(maps: &LevelMaps) -> BTreeSet<[i32; 2]> {
    let columns = maps.columns.max(1);
    let place = |number: u64| i32::try_from(number).unwrap_or(i32::MAX);
    maps.visits.iter().map(|[square, _]| [place(square % columns), place(square / columns)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_harness::foreign::ForeignGame;

    /// Makes a corridor that a wall divides, with the start on the left and the goal on the right.
    fn divided() -> FloorPlan {
        FloorPlan {
            bounds: Rect::new(0.0, 0.0, 8.0, 1.0),
            walls: vec![Rect::new(5.0, 0.0, 6.0, 1.0)],
            start: Vec2::new(0.5, 0.5),
            goal: Vec2::new(7.5, 0.5),
            ..FloorPlan::default()
        }
    }

    fn visits(squares: &[u64]) -> LevelMaps {
        let visits = squares.iter().map(|square| [*square, 3]).collect();
        LevelMaps { side: 1.0, columns: 8, rows: 1, visits, ..LevelMaps::default() }
    }

    fn grid() -> Grid {
        Grid::new(Rect::new(0.0, 0.0, 8.0, 1.0)).expect("an extent")
    }

    #[test]
    fn squares_around_start_and_goal_that_no_tester_visited_are_hatched() {
        let reached = Reached::by_testers(&visits(&[0, 1, 2]), &divided()).expect("it has open squares");
        // Two before the wall, and two behind it.
        assert_eq!(reached.words(), "No tester reached 4 open squares, which the picture has hatched");
        let missed = "d=\"M240 0h80v80h-80zM320 0h80v80h-80zM480 0h80v80h-80zM560 0h80v80h-80z\"";
        assert_eq!(
            reached.svg(&grid(), 4_000),
            format!(
                "<path class=\"reached\" d=\"M0 0h80v80h-80zM80 0h80v80h-80zM160 0h80v80h-80z\"/>\
                 <path class=\"missed\" {missed}/><path class=\"hatched\" fill=\"url(#hatch)\" {missed}/>"
            )
        );
        assert_eq!(reached.share(), 3.0 / 7.0);
        // Of a pair of squares of which one was reached, the pair was.
        let coarse = reached.svg(&grid(), 250);
        assert!(coarse.contains("\"reached\" d=\"M0 0h160v80h-160zM160 0h160v80h-160z\""), "{coarse}");
        assert_eq!(reached.svg(&grid(), 10), "");
    }

    #[test]
    fn squares_that_only_testers_reached_count() {
        let grid = CellGrid { origin: Vec2::ZERO, size: 1.0 };
        let cells = |columns: &[i32]| columns.iter().map(|column| [*column, 0]).collect::<BTreeSet<_>>();
        let explored = || Reached { grid, reached: cells(&[0, 1]), missed: cells(&[2, 3, 6]), is_explored: true };
        let both = explored().with_testers(&visits(&[0, 3]));
        let words = "Neither a tester nor an explorer reached 2 open squares, which the picture has hatched";
        assert_eq!(both.words(), words);
        assert_eq!((both.reached, both.missed), (cells(&[0, 1, 3]), cells(&[2, 6])));
        let all = visits(&[2, 3, 6]);
        assert!(explored().with_testers(&all).words().starts_with("Every square"), "none is missed");
        let wide = LevelMaps { side: 4.0, columns: 2, rows: 1, visits: vec![[1, 9]], ..LevelMaps::default() };
        assert_eq!(explored().with_testers(&wide).missed, cells(&[2, 3]));
    }

    #[test]
    fn maps_that_are_none_have_no_squares() {
        for maps in [LevelMaps::default(), LevelMaps { side: f32::NAN, ..visits(&[0]) }] {
            assert!(Reached::by_testers(&maps, &divided()).is_none(), "{maps:?}");
        }
        let flat = FloorPlan { walls: vec![Rect::new(-1.0, -1.0, 9.0, 9.0)], ..divided() };
        assert!(Reached::by_testers(&visits(&[0]), &flat).is_none(), "the start is in a wall");
        let odd = LevelMaps { columns: 0, visits: vec![[u64::MAX, 1]], ..visits(&[]) };
        assert!(Reached::by_testers(&odd, &divided()).is_some_and(|reached| reached.missed.len() == 7));
    }

    #[test]
    fn steps_run_out_and_games_that_cannot_be_explored_have_no_reach() {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {});
        let explored = std::cell::Cell::new(0);
        let each = || explored.set(explored.get() + 1);
        let explorer = LevelExplorer { threads: 1, each: &each, stop: &|| false };
        let mut left = MOST_STEPS + 5;
        assert!(explorer.explore(&game, "no-such-mode", 0, &mut left).is_none());
        assert_eq!((left, explored.get()), (5, 1));
        assert!(explorer.explore(&game, "no-such-mode", 0, &mut left).is_none());
        assert!(explorer.explore(&game, "no-such-mode", 0, &mut left).is_none());
        assert_eq!((left, explored.get()), (0, 2), "the third one has no steps");
        let stopped = LevelExplorer { stop: &|| true, ..explorer };
        assert!(stopped.explore(&game, "default", 0, &mut 9).is_none());
        assert_eq!(explored.get(), 2);
    }
}
