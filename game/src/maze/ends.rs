//! Start and goal of a generated maze: the difficulty.

use std::ops::RangeInclusive;

use super::{cell::Cell, distances::Distances, draw::Draw, walls::Walls};

/// Starts that are tried for a wanted difficulty.
const STARTS: usize = 32;

/// Draws start and goal: as far apart as possible, or with a shortest path of so many moves.
///
/// Otherwise the moves of the longest shortest path that was found.
pub(super) fn choose_ends(
    walls: &Walls,
    wanted: Option<&RangeInclusive<usize>>,
    draw: &mut Draw,
) -> Result<(Cell, Cell), usize> {
    let free: Vec<_> = walls.free_cells().collect();
    let first = draw.pick(&free).ok_or(0usize)?;
    let (one, other, longest) = far_apart(walls, first);
    let Some(wanted) = wanted else {
        let flip = draw.below(2) == 1;
        return Ok(if flip { (other, one) } else { (one, other) });
    };
    if *wanted.start() > longest {
        return Err(longest);
    }
    // From one end of the longest path every shorter distance occurs: the last start to try always works.
    let starts = (0..STARTS).map(|_| free[draw.below(free.len())]).chain([one]).collect::<Vec<_>>();
    for start in starts {
        let away = Distances::to(walls, start);
        let fits = |cell: &Cell| *cell != start && away.get(*cell).is_some_and(|moves| wanted.contains(&moves));
        let goals: Vec<_> = free.iter().copied().filter(fits).collect();
        if let Some(goal) = draw.pick(&goals) {
            return Ok((start, goal));
        }
    }
    Err(longest)
}

/// Returns two cells far apart and the moves between them: walks to the farthest cell, turns around, and goes on as
/// long as that makes the path longer. Without loops no two cells are farther apart; with loops no cell is farther from
/// either.
fn far_apart(walls: &Walls, from: Cell) -> (Cell, Cell, usize) {
    let (mut one, _) = Distances::to(walls, from).farthest();
    let (mut other, mut longest) = Distances::to(walls, one).farthest();
    loop {
        let (next, moves) = Distances::to(walls, other).farthest();
        if moves <= longest {
            return (one, other, longest);
        }
        (one, other, longest) = (other, next, moves);
    }
}
