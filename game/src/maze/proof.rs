//! Proofs of a path through a maze.

use std::collections::VecDeque;

use playbot_lab::proof::LevelProof;

use super::{cell::Cell, layout::Maze};

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
