//! The planner finds a way wherever there is one, and none that is longer than need be.

use playbot_games::maze::{Cell, GridMove, Map, Maze, MazeSpec, Planner, generate};
use rand_mt::Mt64;

use crate::fixed::{by_id, golden};

/// Checks that a path goes from free cell to free cell beside it, and gives its moves.
fn moves(maze: &Maze, path: &[Cell], from: Cell, to: Cell) -> usize {
    assert_eq!((path.first(), path.last()), (Some(&from), Some(&to)));
    for step in path.windows(2) {
        assert!(maze.neighbours(step[0]).any(|next| next == step[1]), "{} to {}", step[0], step[1]);
    }
    path.len() - 1
}

#[test]
fn golden_shortest_paths() {
    let mut compared = 0;
    for paths in golden().shortest_paths {
        let maze = by_id(&paths.id);
        for (from, to, expected) in paths.pairs {
            let planned = Planner::new(&maze, to).path(from).expect("a way");
            assert_eq!(moves(&maze, &planned, from, to), expected, "{}: {from} to {to}", paths.id);
            let breadth_first = maze.shortest_path_between(from, to).expect("a way");
            assert_eq!(moves(&maze, &breadth_first, from, to), expected, "{}: {from} to {to}", paths.id);
            compared += 1;
        }
    }
    assert!(compared > 100, "{compared} pairs");
}

/// 1,000 random pairs of cells: every one is solved, in as few moves as breadth first.
fn solve_random_pairs(maze: &Maze, seed: u64) {
    let cells: Vec<_> = maze.free_cells().collect();
    let planners: Vec<_> = cells.iter().map(|&goal| Planner::new(maze, goal)).collect();
    let away: Vec<_> = cells.iter().map(|&goal| maze.distances_to(goal)).collect();
    let mut draw = Mt64::new(seed);
    let mut pick = || (draw.next_u64() % cells.len() as u64) as usize;
    for _ in 0..1000 {
        let (from, goal) = (cells[pick()], pick());
        let path = planners[goal].path(from).expect("a way");
        assert_eq!(Some(moves(maze, &path, from, cells[goal])), away[goal].get(from));
    }
}

#[test]
fn a_thousand_random_pairs_on_every_fixed_map() {
    for (seed, name) in (0..).zip(["umaze", "medium", "large", "xl"]) {
        let map = Map::named(name).expect("a map");
        solve_random_pairs(&map.maze2d(0).expect("fixed"), seed);
        solve_random_pairs(&map.antmaze(0).expect("fixed"), seed);
    }
}

#[test]
fn a_thousand_random_pairs_on_generated_mazes() {
    for (seed, loops, corridor) in [(0, 0.0, 1), (64, 0.1, 1), (65, 0.5, 2), (127, 1.0, 1)] {
        let spec = MazeSpec { rows: 17, columns: 14, loops, corridor, difficulty: None };
        solve_random_pairs(&generate(&spec, seed).expect("a maze"), seed);
    }
}

#[test]
fn goals_farther_than_fifty_moves_need_more_sweeps_than_the_original_makes() {
    let corridor = format!("#S{}G#", "O".repeat(198));
    let wall = "#".repeat(corridor.len());
    let maze = Maze::parse(&[&wall, &corridor, &wall]).expect("a maze");
    let planner = Planner::new(&maze, maze.goal());
    assert_eq!(planner.path(maze.start()).map(|path| path.len()), Some(200));
    assert!(planner.sweeps() > 200, "{}", planner.sweeps());
    let medium = by_id("maze2d-medium");
    assert_eq!(Planner::new(&medium, medium.goal()).sweeps(), 50);
}

#[test]
fn values_by_hand() {
    let maze = Maze::parse(&["#####", "#SOG#", "#####"]).expect("a maze");
    let planner = Planner::new(&maze, maze.goal());
    // 50 rewards of 1, each 0.99 of the one before; a cell further away, 49 of them, and so on.
    let sum = |n: i32| (1.0 - 0.99f64.powi(n)) / 0.01;
    let value = |cell, step| planner.action_value(cell, step);
    assert!((value(Cell::new(1, 3), GridMove::Stay) - (1.0 + 0.99 * sum(50))).abs() < 1e-9);
    assert!((value(Cell::new(1, 2), GridMove::Right) - 0.99 * sum(50)).abs() < 1e-9);
    assert!((value(Cell::new(1, 1), GridMove::Right) - 0.99 * 0.99 * sum(49)).abs() < 1e-9);
    assert_eq!(planner.best_move(Cell::new(1, 3)), GridMove::Stay);
    assert_eq!(planner.next_cell(Cell::new(1, 1)), Cell::new(1, 2));
}

#[test]
fn where_there_is_no_way_there_is_no_path() {
    let maze = Maze::parse(&["######", "#SG#O#", "######"]).expect("a maze");
    let planner = Planner::new(&maze, maze.goal());
    assert_eq!(planner.path(Cell::new(1, 4)), None, "cut off");
    assert_eq!(planner.path(Cell::new(0, 0)), None, "a wall");
    assert_eq!(planner.path(Cell::new(9, 9)), None, "outside");
    assert_eq!(Planner::new(&maze, Cell::new(0, 0)).path(maze.start()), None, "the goal is a wall");
    assert_eq!(Planner::new(&maze, Cell::new(9, 9)).path(maze.start()), None, "the goal is outside");
}
