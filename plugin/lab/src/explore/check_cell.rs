//! The check that a level can have a requested cell.

use bevy::math::Rect;

use super::{
    archive::{Archive, Destination},
    cell::Cell,
    error::ExploreError,
    grid::CellGrid,
    job::Job,
    lookout::Lookout,
    plan::ExplorePlan,
    ways::Route,
    world::ExploreWorld,
};
use crate::game::Game;

/// Cells beyond each side of a level that are accepted: agents can be there, for instance above it.
const MARGIN: i64 = 8;
/// Part of a cell by which a level may be longer than its cells, through rounding.
const SLACK: f32 = 1e-3;

/// Plays one tick of the level, and checks a cell: it must have as many numbers as the level's cells, and must not lie
/// far outside.
///
/// # Errors
///
/// [`ExploreError::Plan`] with the valid values, or the plan does not fit the game, or the game breaks its contract.
pub fn check_cell(game: &dyn Game, plan: &ExplorePlan, cell: &Cell) -> Result<(), ExploreError> {
    plan.check(game)?;
    let floor_plan = game.tools().levels.floor_plan(&plan.mode, plan.level);
    let grid = CellGrid::new(floor_plan.as_ref(), plan.cell_size);
    let lookout = Lookout::new(grid, plan.cell_size, None, grid.size);
    let one = ExplorePlan { arenas: 1, worlds: 1, threads: 1, ..plan.clone() };
    let mut world = ExploreWorld::new(game, &one, lookout, 0, 1)?;
    let route = Route::empty(&game.actions());
    let job = Job { number: 0, destination: Destination::START, route, patience: 1, most: 1 };
    let visits = world.play(vec![job], &Archive::new(game.actions()), &|_| {})?;
    let Some(seen) = visits.iter().find_map(|(_, visited)| visited.seen.keys().next()) else { return Ok(()) };
    if seen.0.len() != cell.0.len() {
        return Err(ExploreError::Plan(format!(
            "cell {cell} has the wrong count of numbers: cells of this level have {}, such as {seen}",
            seen.0.len()
        )));
    }
    match floor_plan {
        Some(floor_plan) if world.has_places() => check_bounds(&grid, floor_plan.bounds, cell),
        _ => Ok(()),
    }
}

fn check_bounds(grid: &CellGrid, bounds: Rect, cell: &Cell) -> Result<(), ExploreError> {
    let last = (bounds.size() / grid.size - SLACK).ceil().to_array().map(|count| (count as i64 - 1).max(0));
    let is_near = |(number, last): (&i32, i64)| (-MARGIN..=last + MARGIN).contains(&i64::from(*number));
    if cell.0.iter().zip(last).all(is_near) {
        return Ok(());
    }
    let [column, row] = last;
    Err(ExploreError::Plan(format!(
        "cell {cell} lies outside of the level: its cells go from 0,0 to {column},{row}, column and row, from the lower left \
         corner on"
    )))
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec2;

    use super::*;

    #[test]
    fn cells_far_outside_are_refused_with_those_that_there_are() {
        let grid = CellGrid { origin: Vec2::ZERO, size: 0.5 };
        let check = |numbers: [i32; 2]| check_bounds(&grid, Rect::new(0.0, 0.0, 5.0, 2.0), &Cell(numbers.to_vec()));
        for near in [[0, 0], [9, 3], [9, 5], [-1, 0]] {
            assert!(check(near).is_ok(), "{near:?}");
        }
        for far in [[90, 3], [3, 90], [-90, 0], [i32::MAX, i32::MIN]] {
            let error = check(far).expect_err("far outside").to_string();
            assert!(error.contains("outside of the level: its cells go from 0,0 to 9,3"), "{error}");
        }
    }
}
