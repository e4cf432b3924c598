//! The walls of a maze as few long boxes.

use super::geometry::{CELL, WALL_HEIGHT, centre_of};
use crate::{
    ant::WallBox,
    maze::{Cell, Maze},
};

/// The walls as boxes that together fill exactly the wall cells that anybody can touch.
///
/// Each straight face, however many cells long, belongs to a single box: one box to a cell would have seams for a foot to
/// catch on. Boxes therefore overlap at corners and crossings, which static walls do not mind.
pub fn wall_boxes(maze: &Maze) -> Vec<WallBox> {
    let (rows, columns) = (maze.rows(), maze.columns());
    let rowwise = (0..rows).flat_map(|row| runs(columns, move |col| Cell { row, col }, maze, beside_row));
    let columnwise = (0..columns).flat_map(|col| runs(rows, move |row| Cell { row, col }, maze, beside_column));
    // A single cell is found both ways.
    let (single, long): (Vec<_>, Vec<_>) = rowwise.partition(|run| run.0 == run.1);
    let tall: Vec<_> = columnwise.filter(|run| run.0 != run.1).collect();
    let alone = single.into_iter().filter(|(cell, _)| !is_wall_beside(maze, *cell));
    long.into_iter().chain(tall.iter().copied()).chain(alone).map(|run| wall_box(maze, run)).collect()
}

/// First and last cell.
type Run = (Cell, Cell);

/// The longest runs of walls along a line of cells that somebody can touch from a side.
fn runs<'a>(
    length: usize,
    cell: impl Fn(usize) -> Cell + 'a,
    maze: &'a Maze,
    sides: fn(Cell) -> [Option<Cell>; 2],
) -> impl Iterator<Item = Run> + 'a {
    let mut at = 0;
    std::iter::from_fn(move || {
        loop {
            at = (at..length).find(|&at| !maze.is_free(cell(at)))?;
            let first = at;
            at = (first..length).find(|&at| maze.is_free(cell(at))).unwrap_or(length);
            let touched = |at: usize| sides(cell(at)).into_iter().flatten().any(|beside| maze.is_free(beside));
            if (first..at).any(touched) {
                return Some((cell(first), cell(at - 1)));
            }
        }
    })
}

fn beside_row(Cell { row, col }: Cell) -> [Option<Cell>; 2] {
    [row.checked_sub(1).map(|row| Cell { row, col }), Some(Cell { row: row + 1, col })]
}

fn beside_column(Cell { row, col }: Cell) -> [Option<Cell>; 2] {
    [col.checked_sub(1).map(|col| Cell { row, col }), Some(Cell { row, col: col + 1 })]
}

/// Whether the wall goes on, in any of the four directions, inside the maze.
fn is_wall_beside(maze: &Maze, cell: Cell) -> bool {
    let inside = |cell: &Cell| cell.row < maze.rows() && cell.col < maze.columns();
    let around = beside_row(cell).into_iter().chain(beside_column(cell)).flatten();
    around.filter(inside).any(|cell| !maze.is_free(cell))
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

    fn covers(walls: &[WallBox], [x, y]: [f32; 2]) -> bool {
        let inside = |wall: &WallBox| (x - wall.centre[0]).abs() < wall.half[0] && (y - wall.centre[1]).abs() < wall.half[1];
        walls.iter().any(inside)
    }

    fn mazes() -> Vec<Maze> {
        let random = (0..20).map(|seed| generate(&MazeSpec::default(), seed).expect("a maze"));
        [antmaze::umaze(), antmaze::medium(), antmaze::large(), antmaze::xl()].into_iter().chain(random).collect()
    }

    #[test]
    fn boxes_fill_the_walls_and_nothing_else() {
        for maze in mazes() {
            let walls = wall_boxes(&maze);
            for cell in maze.free_cells() {
                let [x, y] = centre_of(&maze, cell);
                for [dx, dy] in [[0.0, 0.0], [1.99, 1.99], [-1.99, 1.99], [1.99, -1.99], [-1.99, -1.99]] {
                    assert!(!covers(&walls, [x + dx, y + dy]), "{cell} is free");
                }
                // Just beyond each of its four sides.
                let near = [[2.01, 0.0], [-2.01, 0.0], [0.0, 2.01], [0.0, -2.01]];
                for ([dx, dy], beside) in near.into_iter().zip(sides(cell)) {
                    assert_eq!(covers(&walls, [x + dx, y + dy]), !maze.is_free(beside), "{cell} beside {beside}");
                }
            }
        }
    }

    fn sides(Cell { row, col }: Cell) -> [Cell; 4] {
        [(row, col + 1), (row, col - 1), (row + 1, col), (row - 1, col)].map(|(row, col)| Cell { row, col })
    }

    #[test]
    fn every_straight_face_is_that_of_one_box() {
        let maze = antmaze::xl();
        let walls = wall_boxes(&maze);
        for cell in maze.free_cells() {
            // Two neighbouring free cells below the same wall share its face.
            let (next, above) = (Cell { col: cell.col + 1, ..cell }, Cell { row: cell.row - 1, ..cell });
            let above_next = Cell { col: above.col + 1, ..above };
            if !maze.is_free(next) || maze.is_free(above) || maze.is_free(above_next) {
                continue;
            }
            let ([x, y], [other, _]) = (centre_of(&maze, above), centre_of(&maze, above_next));
            assert!(walls.iter().any(|wall| covers(std::slice::from_ref(wall), [x, y]) && covers(std::slice::from_ref(wall), [other, y])));
        }
        assert!(walls.len() < maze.wall_cells().count() / 2, "{} boxes", walls.len());
    }
}
