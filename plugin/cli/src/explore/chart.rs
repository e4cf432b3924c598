//! Picture of the cells that an explorer reached.

use playbot_lab::{
    explore::{Cell, Exploration, Route, follow_route},
    floor_plan::FloorPlan,
    game::Game,
    report::CellChart,
};

use crate::error::CliError;

/// Draws the cells of an exploration on the level's floor plan, with a path through them.
///
/// # Errors
///
/// The game breaks its contract when the path is played again.
pub fn chart(
    game: &dyn Game,
    plan: FloorPlan,
    exploration: &Exploration,
    way: Option<&Route>,
) -> Result<CellChart, CliError> {
    let Exploration { mode, level, grid, .. } = exploration;
    let mut places = Vec::new();
    if let Some(route) = way {
        places.push(plan.start);
        places.extend(follow_route(game, mode, *level, &route.actions)?);
    }
    let area = |cell: &Cell| grid.as_ref()?.area(cell);
    let cells = exploration.cells().iter();
    let reached = cells.filter_map(|(cell, reached)| Some((area(cell)?, reached.visits))).collect();
    let summary = exploration.summary(game).to_string();
    Ok(CellChart {
        title: format!("Cells that an explorer reached in {} {mode}:{level}", game.name()),
        captions: summary
            .lines()
            .chain(["cells: few to many visits, logarithmic; crossed: not reached"])
            .map(str::to_owned)
            .collect(),
        plan,
        reached,
        missed: exploration.missed().filter_map(area).collect(),
        way: places,
    })
}
