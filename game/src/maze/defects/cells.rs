//! Defects of walls: invisible ones, and ones without effect.

use crate::{
    defect_variant::place,
    maze::{Cell, Maze},
};

/// Returns the maze with one more wall, on the shortest path from one cell to another; `None` if the path has no cell
/// between.
pub(super) fn walled_on_the_way(maze: &Maze, start: Cell, goal: Cell, variant: u32) -> Option<Maze> {
    let path = maze.shortest_path_between(start, goal)?;
    let last = path.len().checked_sub(2).filter(|&last| last > 0)?;
    redrawn(maze, path[on_the_way(variant, path.len()).clamp(1, last)], '#')
}

/// Returns the maze without one of its walls: one between two free cells, the first from the variant's place on along
/// the path.
pub(super) fn wall_gone_beside_the_way(maze: &Maze, start: Cell, goal: Cell, variant: u32) -> Option<Maze> {
    let path = maze.shortest_path_between(start, goal)?;
    let from = on_the_way(variant, path.len()).min(path.len() - 1);
    let cells = path[from..].iter().chain(path[..from].iter().rev());
    let wall = cells.flat_map(|&cell| walls_beside(maze, cell)).find(|&wall| is_between(maze, wall))?;
    redrawn(maze, wall, 'O')
}

/// Returns a quarter, a half or three quarters of the path.
fn on_the_way(variant: u32, length: usize) -> usize {
    length * (place(variant) + 1) / 4
}

/// Returns the walls that share a side with a free cell.
fn walls_beside(maze: &Maze, cell: Cell) -> impl Iterator<Item = Cell> {
    // A free cell is never at the border.
    let Cell { row, col } = cell;
    let beside = [Cell::new(row - 1, col), Cell::new(row + 1, col), Cell::new(row, col - 1), Cell::new(row, col + 1)];
    beside.map(|cell| (!maze.is_free(cell)).then_some(cell)).into_iter().flatten()
}

/// Returns true if a wall parts two free cells.
fn is_between(maze: &Maze, wall: Cell) -> bool {
    let Cell { row, col } = wall;
    let inside = row > 0 && col > 0 && row + 1 < maze.rows() && col + 1 < maze.columns();
    let free = |row: usize, col: usize| maze.is_free(Cell::new(row, col));
    inside && (free(row - 1, col) && free(row + 1, col) || free(row, col - 1) && free(row, col + 1))
}

/// Returns the maze with another letter in a cell; `None` if it is the start or the goal of the map.
pub(super) fn redrawn(maze: &Maze, cell: Cell, letter: char) -> Option<Maze> {
    let mut rows: Vec<Vec<char>> = maze.to_rows().iter().map(|row| row.chars().collect()).collect();
    *rows.get_mut(cell.row)?.get_mut(cell.col)? = letter;
    let rows: Vec<String> = rows.into_iter().map(String::from_iter).collect();
    Maze::parse_drawn(&rows, Some(maze.start()), Some(maze.goal())).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maze::{MazeSpec, generate};

    #[test]
    fn one_wall_more_or_less_and_start_and_goal_stay() {
        let mut found = [0, 0];
        for seed in 0..20 {
            let maze = generate(&MazeSpec::default(), seed).expect("a maze");
            let (start, goal) = (maze.start(), maze.goal());
            for variant in 0..3 {
                let walls = |maze: &Maze| maze.wall_cells().count();
                if let Some(more) = walled_on_the_way(&maze, start, goal, variant) {
                    found[0] += 1;
                    assert_eq!((walls(&more), more.start(), more.goal()), (walls(&maze) + 1, start, goal));
                    assert!(more.difficulty() == 0 || more.difficulty() >= maze.difficulty());
                }
                if let Some(less) = wall_gone_beside_the_way(&maze, start, goal, variant) {
                    found[1] += 1;
                    assert_eq!((walls(&less) + 1, less.start(), less.goal()), (walls(&maze), start, goal));
                }
            }
        }
        assert_eq!(found[0], 60);
        assert!(found[1] > 50, "{found:?}");
    }
}
