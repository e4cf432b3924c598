//! Best moves to a goal from everywhere, by the values of moves.

use crate::maze::{Cell, Maze, rows::Walls};
use playbot_harness::detector::LevelProof;
use std::collections::VecDeque;

/// The planner's actions in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GridMove {
    /// Stay.
    Stay,
    /// To the row above.
    Up,
    /// To the row below.
    Down,
    /// To the column on the left.
    Left,
    /// To the column on the right.
    Right,
}

impl GridMove {
    /// All moves, in the order in which ties are resolved.
    pub const ALL: [Self; 5] = [Self::Stay, Self::Up, Self::Down, Self::Left, Self::Right];

    /// Returns the cell this leads to; a wall leaves it at the same cell.
    pub fn from(self, maze: &Maze, cell: Cell) -> Cell {
        let Cell { row, col } = cell;
        let to = match self {
            Self::Stay => cell,
            Self::Up => Cell { row: row.wrapping_sub(1), col },
            Self::Down => Cell { row: row + 1, col },
            Self::Left => Cell { row, col: col.wrapping_sub(1) },
            Self::Right => Cell { row, col: col + 1 },
        };
        if maze.is_free(to) { to } else { cell }
    }
}

/// The best moves to a goal as D4RL's demonstrator plans them. They follow from Q-values of five deterministic moves,
/// with reward 1 for any move in the goal cell and discount 0.99.
///
/// The original sweeps 50 times over all cells, so its goal is unknown farther than 50 moves away. The limit of its
/// sweeps needs no counterpart here. The value of a cell that is d moves away is 0.99^d / (1 - 0.99). So the move of
/// the highest Q-value is the one to the least d. Therefore the cells are visited once, nearest first. Mazes of any
/// size are planned in the time it takes to read them.
#[derive(Clone, Debug)]
pub struct Planner {
    maze: Maze,
    goal: Cell,
    moves: Distances,
}

impl Planner {
    /// Plans paths to `goal`. If it is a wall, there are none.
    pub fn new(maze: &Maze, goal: Cell) -> Self {
        Self { maze: maze.clone(), goal, moves: maze.distances_to(goal) }
    }

    /// Returns the best move from a free cell; the first of equals. Stays at the goal and where no path leads there.
    pub fn best_move(&self, cell: Cell) -> GridMove {
        let away = |step: &GridMove| self.moves.get(step.from(&self.maze, cell)).unwrap_or(usize::MAX);
        GridMove::ALL.into_iter().min_by_key(away).unwrap_or(GridMove::Stay)
    }

    /// Returns the cell of the best move; the cell itself at the goal.
    pub fn next_cell(&self, cell: Cell) -> Cell {
        self.best_move(cell).from(&self.maze, cell)
    }

    /// Returns the cells of the best path, from `from` to the goal, both included. `None` if `from` is a wall or has no
    /// path there.
    pub fn path(&self, from: Cell) -> Option<Vec<Cell>> {
        if !self.maze.is_free(from) {
            return None;
        }
        let mut path = vec![from];
        let mut at = from;
        while at != self.goal {
            let next = self.next_cell(at);
            if next == at {
                return None;
            }
            path.push(next);
            at = next;
        }
        Some(path)
    }

    /// Returns the goal.
    pub fn goal(&self) -> Cell {
        self.goal
    }
}

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

/// Proves whether a player can get from one cell to another.
///
/// Solvable: there is a path over free cells that lie side by side. Unsolvable: there is none even over two free cells
/// that touch at a corner only, which no body of any size can use. The proof therefore holds for any bodies, walls and
/// radius of the goal, as long as that is smaller than a wall. Between the two nothing is proved.
pub fn prove(maze: &Maze, start: Cell, goal: Cell) -> LevelProof {
    if !maze.is_free(start) || !maze.is_free(goal) {
        return LevelProof::Unknown;
    }
    if maze.distances_to(goal).get(start).is_some() {
        return LevelProof::Solvable;
    }
    if is_reached_over_corners(maze, start, goal) {
        return LevelProof::Unknown;
    }
    let why = format!(
        "no path leads from the start {start} to the goal {goal}: a search over all free cells, corners included, ended \
         without reaching it"
    );
    LevelProof::Unsolvable { why }
}

fn is_reached_over_corners(maze: &Maze, start: Cell, goal: Cell) -> bool {
    let mut seen = vec![false; maze.rows() * maze.columns()];
    let mut queue = VecDeque::from([start]);
    while let Some(cell) = queue.pop_front() {
        if cell == goal {
            return true;
        }
        for row in cell.row.saturating_sub(1)..=cell.row + 1 {
            for col in cell.col.saturating_sub(1)..=cell.col + 1 {
                let next = Cell { row, col };
                // Cells outside are not free.
                if maze.is_free(next) && !std::mem::replace(&mut seen[row * maze.columns() + col], true) {
                    queue.push_back(next);
                }
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(rows: &[&str], start: [usize; 2], goal: [usize; 2]) -> LevelProof {
        prove(&Maze::parse(rows).expect("a maze"), start.into(), goal.into())
    }

    #[test]
    fn walls_all_around_are_a_proof_and_a_corner_is_none() {
        let sealed = ["#######", "#SG#OO#", "#OO####", "#######"];
        assert_eq!(cells(&sealed, [1, 1], [2, 2]), LevelProof::Solvable);
        let proof = cells(&sealed, [1, 1], [1, 5]);
        assert!(proof.why_unsolvable().is_some_and(|why| why.contains("(1, 1)") && why.contains("(1, 5)")));
        let cornered = ["######", "#SGO##", "####O#", "######"];
        assert_eq!(cells(&cornered, [1, 1], [2, 4]), LevelProof::Unknown);
        assert_eq!(cells(&cornered, [1, 1], [0, 0]), LevelProof::Unknown, "no place to go to");
    }
}
