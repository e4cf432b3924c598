//! Distances in a maze, breadth first.

use std::collections::VecDeque;

use super::{cell::Cell, walls::Walls};

/// The number of moves from every cell to one of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Distances {
    columns: usize,
    moves: Vec<Option<u32>>,
    farthest: (Cell, u32),
}

impl Distances {
    pub(super) fn to(walls: &Walls, cell: Cell) -> Self {
        let mut found =
            Self { columns: walls.columns, moves: vec![None; walls.rows * walls.columns], farthest: (cell, 0) };
        if !walls.is_free(cell) {
            return found;
        }
        let mut queue = VecDeque::from([(cell, 0)]);
        found.moves[walls.index(cell)] = Some(0);
        while let Some((cell, moves)) = queue.pop_front() {
            if moves > found.farthest.1 {
                found.farthest = (cell, moves);
            }
            for next in walls.neighbours(cell) {
                let known = &mut found.moves[walls.index(next)];
                if known.is_none() {
                    *known = Some(moves + 1);
                    queue.push_back((next, moves + 1));
                }
            }
        }
        found
    }

    /// Moves from this cell; `None` if it is a wall, outside, or cut off.
    pub fn get(&self, cell: Cell) -> Option<usize> {
        let index = (cell.col < self.columns).then_some(cell.row * self.columns + cell.col)?;
        self.moves.get(index).copied().flatten().map(|moves| moves as usize)
    }

    /// Returns the cell from which it is farthest, and its moves. Of several, the one that a breadth-first search meets
    /// first.
    pub fn farthest(&self) -> (Cell, usize) {
        (self.farthest.0, self.farthest.1 as usize)
    }

    /// Returns the number of cells with a path to it, the cell itself included.
    pub fn reached(&self) -> usize {
        self.moves.iter().flatten().count()
    }
}
