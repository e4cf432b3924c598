//! The walls of a maze as few long boxes.

use super::geometry::{CELL, WALL_HEIGHT, centre_of};
use crate::{
    ant::WallBox,
    maze::{Cell, Maze},
};

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
