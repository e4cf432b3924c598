//! Conversion between cells and metres.

use crate::maze::{Cell, Maze};

/// Side of a cell, metres.
pub const CELL: f32 = 4.0;
/// Height of the walls, metres.
pub const WALL_HEIGHT: f32 = 2.0;

/// Returns the middle of a cell, `[x, y]` in metres. The maze's start cell is at the origin, columns go along x and
/// rows along y.
pub fn centre_of(maze: &Maze, cell: Cell) -> [f32; 2] {
    let along = |index: usize, origin: usize| CELL * (index as f32 - origin as f32);
    [along(cell.col, maze.start().col), along(cell.row, maze.start().row)]
}

/// Returns the cell around a position `[x, y]`, wall or free; `None` outside the maze.
///
/// A cell is the square around its centre. The original rounds down instead, which counts half of each cell as its
/// neighbour.
pub fn cell_at(maze: &Maze, [x, y]: [f32; 2]) -> Option<Cell> {
    let index = |at: f32, origin: usize, length: usize| {
        let index = (at / CELL).round() + origin as f32;
        (0.0..length as f32).contains(&index).then_some(index as usize)
    };
    Some(Cell { row: index(y, maze.start().row, maze.rows())?, col: index(x, maze.start().col, maze.columns())? })
}

/// Returns the distance of two positions, metres.
pub fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    let [dx, dy] = [a[0] - b[0], a[1] - b[1]];
    (dx * dx + dy * dy).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maze::fixed::antmaze;

    #[test]
    fn goals_are_where_the_original_has_them() {
        for (maze, goal) in
            [(antmaze::medium(), [20.0, 20.0]), (antmaze::large(), [32.0, 24.0]), (antmaze::xl(), [68.0, 48.0])]
        {
            assert_eq!(centre_of(&maze, maze.start()), [0.0, 0.0]);
            assert_eq!(centre_of(&maze, maze.goal()), goal);
        }
    }

    #[test]
    fn every_place_in_a_cell_leads_back_to_it() {
        let maze = antmaze::large();
        for cell in maze.free_cells().chain(maze.wall_cells()) {
            let [x, y] = centre_of(&maze, cell);
            for [dx, dy] in [[0.0, 0.0], [1.99, -1.99], [-1.99, 1.99]] {
                assert_eq!(cell_at(&maze, [x + dx, y + dy]), Some(cell));
            }
        }
        for outside in [[-6.01, 0.0], [0.0, -6.01], [42.01, 0.0], [0.0, 30.01], [f32::NAN, 0.0]] {
            assert_eq!(cell_at(&maze, outside), None, "{outside:?}");
        }
    }
}
