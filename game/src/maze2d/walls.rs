//! The walls of the ball: squares of side 1, one for each wall cell.

use crate::maze::{Cell, Maze};

use super::ball::{RADIUS, Vec2d, add, length, sub};

/// Offset of D4RL's walls from their coordinates, along both axes: a cell (i, j) is centred at (i - 0.2, j - 0.2).
/// Starts, goals and rewards use (i, j).
pub const D4RL_OFFSET: f64 = 0.2;

/// Half the side of a wall.
pub const HALF: f64 = 0.5;

/// The walls of a maze in the coordinates of the observation.
#[derive(Clone, Debug)]
pub struct Walls {
    rows: usize,
    columns: usize,
    solid: Vec<bool>,
    offset: f64,
}

/// A wall within reach of the ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Unit vector from the wall to the centre of the ball.
    pub normal: Vec2d,
    /// Distance between the surfaces, m; negative if they overlap.
    pub gap: f64,
}

/// Most walls that a ball can be near: the cells around its own, without the one it is in.
const MOST: usize = 9;

/// The walls near a ball.
#[derive(Clone, Copy, Debug)]
pub struct Touches {
    list: [Touch; MOST],
    len: usize,
}

impl Touches {
    /// Returns the walls, in the order of their rows and columns.
    pub fn as_slice(&self) -> &[Touch] {
        &self.list[..self.len]
    }
}

impl Walls {
    /// Returns the walls of a maze, moved by `-offset` along both axes.
    pub fn new(maze: &Maze, offset: f64) -> Self {
        let (rows, columns) = (maze.rows(), maze.columns());
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |col| Cell::new(row, col)));
        let solid = cells.map(|cell| !maze.is_free(cell)).collect();
        Self { rows, columns, solid, offset }
    }

    /// Returns true if a cell is a wall; everything outside the maze is.
    pub(super) fn is_solid(&self, row: i32, column: i32) -> bool {
        match (usize::try_from(row), usize::try_from(column)) {
            (Ok(row), Ok(column)) if row < self.rows && column < self.columns => {
                self.solid[row * self.columns + column]
            }
            _ => true,
        }
    }

    /// Returns the offset of the walls, along both axes.
    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// Returns the centre of a cell.
    pub fn centre(&self, row: i32, column: i32) -> Vec2d {
        [f64::from(row) - self.offset, f64::from(column) - self.offset]
    }

    /// Returns the cell around a position, as row and column; it may lie outside the maze.
    pub fn cell_at(&self, place: Vec2d) -> (i32, i32) {
        let [row, column] = place.map(|along| (along + self.offset).round() as i32);
        (row, column)
    }

    /// Returns true if a position lies in a free cell.
    pub fn is_free(&self, place: Vec2d) -> bool {
        let (row, column) = self.cell_at(place);
        !self.is_solid(row, column)
    }

    /// Returns row and column of every wall, in this order.
    pub fn cells(&self) -> impl Iterator<Item = (i32, i32)> {
        let cells = (0..self.rows as i32).flat_map(|row| (0..self.columns as i32).map(move |column| (row, column)));
        cells.filter(|&(row, column)| self.is_solid(row, column))
    }

    /// Returns the walls whose surface is closer than `margin` to that of a ball.
    pub fn touches(&self, place: Vec2d, margin: f64) -> Touches {
        let mut found = Touches { list: [Touch { normal: [0.0; 2], gap: 0.0 }; MOST], len: 0 };
        let (row, column) = self.cell_at(place);
        if self.is_clear(place, row, column, margin) {
            return found;
        }
        for row in row - 1..=row + 1 {
            for column in column - 1..=column + 1 {
                if !self.is_solid(row, column) {
                    continue;
                }
                let touch = touch(self.centre(row, column), place);
                if touch.gap < margin {
                    found.list[found.len] = touch;
                    found.len += 1;
                }
            }
        }
        found
    }

    /// Returns true if a position is so far within its free cell that no wall can be near: most are.
    fn is_clear(&self, place: Vec2d, row: i32, column: i32, margin: f64) -> bool {
        let [x, y] = sub(place, self.centre(row, column));
        x.abs().max(y.abs()) <= HALF - RADIUS - margin && !self.is_solid(row, column)
    }
}

/// Returns the contact of a ball and a wall.
fn touch(centre: Vec2d, place: Vec2d) -> Touch {
    let from = sub(place, centre);
    let nearest = add(centre, from.map(|along| along.clamp(-HALF, HALF)));
    let out = sub(place, nearest);
    let distance = length(out);
    if distance > 0.0 {
        return Touch { normal: out.map(|along| along / distance), gap: distance - RADIUS };
    }
    // The centre is inside the wall, where no legal play leads: the direction is out through the nearest side.
    let axis = usize::from(from[1].abs() > from[0].abs());
    let mut normal = [0.0; 2];
    normal[axis] = if from[axis] < 0.0 { -1.0 } else { 1.0 };
    Touch { normal, gap: from[axis].abs() - HALF - RADIUS }
}
