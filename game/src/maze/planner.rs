//! Best moves to a goal from everywhere, by the values of moves.

use super::{cell::Cell, distances::Distances, layout::Maze};

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

/// The best moves to a goal as D4RL's demonstrator plans them: Q-values of five deterministic moves, with reward 1 for
/// any move in the goal cell and discount 0.99.
///
/// The original sweeps 50 times over all cells, so its goal is unknown farther than 50 moves away. The limit of its
/// sweeps needs none: the value of a cell that is d moves away is 0.99^d / (1 - 0.99), and the move of the highest
/// Q-value is the one to the least d. So the cells are visited once, nearest first, and mazes of any size are planned
/// in the time it takes to read them.
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
