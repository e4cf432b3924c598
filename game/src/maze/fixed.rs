//! The maps of the literature: D4RL's, and the extra large one of the SCORE paper.
//!
//! Maze2D and AntMaze share their walls from medium on. The original Maze2D draws its start at random. The option for a
//! fixed start takes the `S` of these maps, in the corner where AntMaze starts.

use crate::maze::{Cell, Maze};
use std::sync::LazyLock;

fn map<const N: usize>(rows: [&str; N]) -> Maze {
    Maze::parse(&rows).expect("a map that tests read")
}

fn with_ends(maze: &Maze, start: Cell, goal: Cell) -> Maze {
    maze.clone().with_ends(start, goal).expect("ends that tests read")
}

static UMAZE: LazyLock<Maze> = LazyLock::new(|| map(["#####", "#GOO#", "###O#", "#SOO#", "#####"]));

static MEDIUM: LazyLock<Maze> = LazyLock::new(|| {
    map(["########", "#SO##OO#", "#OO#OOO#", "##OOO###", "#OO#OOO#", "#O#OO#O#", "#OOO#OG#", "########"])
});

static LARGE: LazyLock<Maze> = LazyLock::new(|| {
    map([
        "############",
        "#SOOO#OOOOO#",
        "#O##O#O#O#O#",
        "#OOOOOO#OOO#",
        "#O####O###O#",
        "#OO#O#OOOOO#",
        "##O#O#O#O###",
        "#OO#OOO#OGO#",
        "############",
    ])
});

static XL: LazyLock<Maze> = LazyLock::new(|| {
    map([
        "######################",
        "#SOOO#OOOOOOOOO#OOOOO#",
        "#O##O#O#O#OO##O#O#O#O#",
        "#OOOOOO#OOOOOOOOO#OOO#",
        "#O####O###OO####O###O#",
        "#OO#O#OOOOOOO#O#OOOOO#",
        "##O#O#O#O###O#O#O#O###",
        "#OO#OOO#OOOOO#OOO#OOO#",
        "#OOOO#OOOOOOOOO#OOOOO#",
        "#O##O#O#O#OO##O#O#O#O#",
        "#OOOOOO#OOOOOOOOO#OOO#",
        "#O####O###OO####O###O#",
        "#OO#O#OOOOOOO#O#OOOOO#",
        "##O#O#O#O###O#O#O#G###",
        "#OO#OOO#OOOOO#OOO#OOO#",
        "######################",
    ])
});

/// The maps of Maze2D.
pub mod maze2d {
    use super::*;

    /// Returns D4RL's `U`: 5 x 5 cells. The fixed start is the far end.
    pub fn umaze() -> Maze {
        UMAZE.clone()
    }

    /// Returns the map of 8 x 8 cells.
    pub fn medium() -> Maze {
        MEDIUM.clone()
    }

    /// Returns the map of 9 x 12 cells.
    pub fn large() -> Maze {
        LARGE.clone()
    }

    /// Returns the map of 16 x 22 cells: the walls of AntMaze's. D4RL has no Maze2D of this size.
    pub fn xl() -> Maze {
        XL.clone()
    }
}

/// The maps of AntMaze, with the start and goal of the measurements.
pub mod antmaze {
    use super::*;

    /// Returns D4RL's `U`: 5 x 5 cells.
    pub fn umaze() -> Maze {
        with_ends(&UMAZE, Cell::new(1, 1), Cell::new(3, 1))
    }

    /// Returns the map of 8 x 8 cells.
    pub fn medium() -> Maze {
        MEDIUM.clone()
    }

    /// Returns the map of 9 x 12 cells.
    pub fn large() -> Maze {
        LARGE.clone()
    }

    /// Returns the extra large map of the SCORE paper: 16 x 22 cells.
    pub fn xl() -> Maze {
        XL.clone()
    }

    /// Goals of the demonstrations on [`umaze`]: the goal itself.
    pub const UMAZE_DEMO_GOALS: [Cell; 1] = [Cell::new(3, 1)];
    /// Goals of the demonstrations on [`medium`].
    pub const MEDIUM_DEMO_GOALS: [Cell; 3] = cells([(2, 6), (5, 1), (6, 5)]);
    /// Goals of the demonstrations on [`large`].
    pub const LARGE_DEMO_GOALS: [Cell; 7] = cells([(1, 6), (3, 5), (3, 10), (5, 2), (7, 4), (7, 6), (7, 9)]);
    /// Goals of the demonstrations on [`xl`].
    pub const XL_DEMO_GOALS: [Cell; 22] = cells([
        (1, 6),
        (1, 16),
        (2, 14),
        (3, 3),
        (3, 8),
        (3, 18),
        (5, 10),
        (6, 4),
        (6, 16),
        (8, 8),
        (8, 13),
        (8, 20),
        (10, 4),
        (10, 14),
        (11, 10),
        (12, 7),
        (13, 2),
        (13, 12),
        (13, 18),
        (14, 6),
        (14, 15),
        (14, 20),
    ]);

    const fn cells<const N: usize>(pairs: [(usize, usize); N]) -> [Cell; N] {
        let mut cells = [Cell::new(0, 0); N];
        let mut at = 0;
        while at < N {
            cells[at] = Cell::new(pairs[at].0, pairs[at].1);
            at += 1;
        }
        cells
    }
}
