//! The way to a goal from everywhere, by value iteration.

use super::{cell::Cell, layout::Maze};

/// Discount of the rewards.
const DISCOUNT: f64 = 0.99;
/// Sweeps of the original, enough for its maps. More follow while values still reach new cells.
const LEAST_SWEEPS: usize = 50;

/// What the planner can do in a cell.
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

    /// The cell this leads to: whoever walks into a wall stays.
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

/// Value iteration over the cells of a maze, as D4RL's demonstrator plans: five deterministic moves, reward 1 for whatever
/// is done in the goal cell, discount 0.99.
///
/// The original makes 50 sweeps, with which a goal is not known farther than 50 moves away. Here sweeps go on until the
/// values have reached every cell that has a way to the goal; on the fixed maps 50 are enough. Values fade by 0.99 a move:
/// 70,000 moves away they are 0, and there the goal counts as out of reach.
#[derive(Clone, Debug)]
pub struct Planner {
    maze: Maze,
    goal: Cell,
    /// Value of each cell, row by row.
    values: Vec<f64>,
    sweeps: usize,
}

impl Planner {
    /// Plans ways to `goal`. If it is a wall, there are none.
    pub fn new(maze: &Maze, goal: Cell) -> Self {
        let size = maze.rows() * maze.columns();
        let mut planner = Self { maze: maze.clone(), goal, values: vec![0.0; size], sweeps: 0 };
        if maze.is_free(goal) {
            planner.iterate();
        }
        planner
    }

    fn iterate(&mut self) {
        let cells: Vec<_> = self.maze.free_cells().collect();
        let mut next = self.values.clone();
        let mut reached = 0;
        loop {
            let mut now = 0;
            for &cell in &cells {
                let best = GridMove::ALL.map(|step| self.action_value(cell, step)).into_iter().fold(0.0, f64::max);
                next[self.maze.walls().index(cell)] = best;
                now += usize::from(best > 0.0);
            }
            std::mem::swap(&mut self.values, &mut next);
            self.sweeps += 1;
            if self.sweeps >= LEAST_SWEEPS && now == reached {
                return;
            }
            reached = now;
        }
    }

    /// Value of a move from a free cell: its reward and the discounted value of where it leads.
    pub fn action_value(&self, cell: Cell, step: GridMove) -> f64 {
        let reward = f64::from(u8::from(cell == self.goal));
        reward + DISCOUNT * self.values[self.maze.walls().index(step.from(&self.maze, cell))]
    }

    /// The best move from a free cell; the first of equals.
    pub fn best_move(&self, cell: Cell) -> GridMove {
        let better = |best: (GridMove, f64), step| {
            let value = self.action_value(cell, step);
            if value > best.1 { (step, value) } else { best }
        };
        let stay = (GridMove::Stay, self.action_value(cell, GridMove::Stay));
        GridMove::ALL.into_iter().fold(stay, better).0
    }

    /// Where the best move leads; the cell itself at the goal.
    pub fn next_cell(&self, cell: Cell) -> Cell {
        self.best_move(cell).from(&self.maze, cell)
    }

    /// The cells of the best way, from `from` to the goal, both included. `None` if `from` is a wall or has no way there.
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

    /// The goal.
    pub fn goal(&self) -> Cell {
        self.goal
    }

    /// Number of sweeps that were made.
    pub fn sweeps(&self) -> usize {
        self.sweeps
    }
}
