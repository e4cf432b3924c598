//! Conversion between cells and metres.

use crate::{
    ant::WallBox,
    maze::{Cell, Maze},
};

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

// The walls of a maze as few long boxes.

/// First and last cell of a straight piece of wall.
type Run = (Cell, Cell);

/// Returns the walls within reach, as boxes that do not overlap.
///
/// Along rows, and then along columns, neighbouring cells become one box. That makes fewer boxes, and fewer of the
/// seams at which the original's boxes, one to a cell, meet. There are none where the original has none.
pub fn wall_boxes(maze: &Maze) -> Vec<WallBox> {
    let (rows, columns) = (maze.rows(), maze.columns());
    let in_rows = (0..rows).flat_map(|row| runs(columns, |col| Cell { row, col }, |cell| !maze.is_free(cell)));
    // A cell without neighbours in its row may be part of a column.
    let (alone, mut found): (Vec<Run>, Vec<Run>) = in_rows.partition(|run| run.0 == run.1);
    let mut is_alone = vec![false; rows * columns];
    alone.iter().for_each(|(cell, _)| is_alone[cell.row * columns + cell.col] = true);
    for col in 0..columns {
        found.extend(runs(rows, |row| Cell { row, col }, |cell| is_alone[cell.row * columns + col]));
    }
    found.retain(|run| cells(*run).any(|cell| maze.neighbours(cell).next().is_some()));
    found.into_iter().map(|run| wall_box(maze, run)).collect()
}

/// Returns the longest runs of marked cells in a line.
fn runs(length: usize, cell: impl Fn(usize) -> Cell, belongs: impl Fn(Cell) -> bool) -> Vec<Run> {
    let mut runs = Vec::new();
    let mut first = None;
    for at in 0..=length {
        match (first, at < length && belongs(cell(at))) {
            (None, true) => first = Some(at),
            (Some(start), false) => {
                runs.push((cell(start), cell(at - 1)));
                first = None;
            }
            _ => {}
        }
    }
    runs
}

fn cells((first, last): Run) -> impl Iterator<Item = Cell> {
    (first.row..=last.row).flat_map(move |row| (first.col..=last.col).map(move |col| Cell { row, col }))
}

fn wall_box(maze: &Maze, (first, last): Run) -> WallBox {
    let ([left, low], [right, high]) = (centre_of(maze, first), centre_of(maze, last));
    let (middle, half) = (|a: f32, b: f32| (a + b) / 2.0, |a: f32, b: f32| (b - a + CELL) / 2.0);
    WallBox {
        centre: [middle(left, right), middle(low, high), WALL_HEIGHT / 2.0],
        half: [half(left, right), half(low, high), WALL_HEIGHT / 2.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maze::{MazeSpec, fixed::antmaze, generate};

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

    /// Returns the number of boxes at a position.
    fn boxes_at(walls: &[WallBox], [x, y]: [f32; 2]) -> usize {
        let near =
            |wall: &&WallBox| (x - wall.centre[0]).abs() < wall.half[0] && (y - wall.centre[1]).abs() < wall.half[1];
        walls.iter().filter(near).count()
    }

    fn mazes() -> Vec<Maze> {
        let spec = |loops, corridor| MazeSpec { loops, corridor, ..MazeSpec::default() };
        let random =
            (0..20).map(|seed| generate(&spec(0.05 * seed as f64, 1 + seed as usize % 2), seed).expect("a maze"));
        [antmaze::umaze(), antmaze::medium(), antmaze::large(), antmaze::xl()].into_iter().chain(random).collect()
    }

    #[test]
    fn boxes_fill_the_walls_once_and_nothing_else() {
        for maze in mazes() {
            let walls = wall_boxes(&maze);
            assert!(walls.iter().all(|wall| (wall.centre[2], wall.half[2]) == (1.0, 1.0)), "2 m high, on the floor");
            for cell in maze.free_cells() {
                let ([x, y], Cell { row, col }) = (centre_of(&maze, cell), cell);
                for [dx, dy] in [[0.0, 0.0], [1.99, 1.99], [-1.99, 1.99], [1.99, -1.99], [-1.99, -1.99]] {
                    assert_eq!(boxes_at(&walls, [x + dx, y + dy]), 0, "{cell} is free");
                }
                // Just beyond each of its four sides.
                let beside = [(row, col + 1), (row, col - 1), (row + 1, col), (row - 1, col)];
                for ([dx, dy], (row, col)) in
                    [[2.01, 0.3], [-2.01, 0.3], [0.3, 2.01], [0.3, -2.01]].into_iter().zip(beside)
                {
                    let is_wall = !maze.is_free(Cell { row, col });
                    assert_eq!(
                        boxes_at(&walls, [x + dx, y + dy]),
                        usize::from(is_wall),
                        "{cell} beside ({row}, {col})"
                    );
                }
            }
        }
    }

    #[test]
    fn boxes_are_few() {
        let count = |maze: &Maze| (wall_boxes(maze).len(), maze.wall_cells().count());
        for maze in mazes() {
            let (boxes, cells) = count(&maze);
            assert!(2 * boxes < cells, "{boxes} boxes for {cells} cells");
        }
    }
}
