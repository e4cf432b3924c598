//! Tests of the planner: it finds a path wherever there is one, and always a shortest one.

use std::collections::BTreeMap;

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
    let all = golden().shortest_paths;
    assert!(!all.is_empty());
    for paths in all {
        let maze = by_id(&paths.id);
        assert!(!paths.pairs.is_empty(), "{}: no pairs", paths.id);
        for (from, to, expected) in paths.pairs {
            let planned = Planner::new(&maze, to).path(from).expect("a way");
            assert_eq!(moves(&maze, &planned, from, to), expected, "{}: {from} to {to}", paths.id);
            let breadth_first = maze.shortest_path_between(from, to).expect("a way");
            assert_eq!(moves(&maze, &breadth_first, from, to), expected, "{}: {from} to {to}", paths.id);
        }
    }
}

/// Plans 1,000 random pairs of cells: every one is solved, in as few moves as breadth first.
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

/// Returns the values of Q-value iteration as in the original: reward 1 in the goal cell, discount 0.99, 50 sweeps over
/// all cells.
fn swept(maze: &Maze, goal: Cell) -> impl Fn(Cell, GridMove) -> f64 {
    let cells: Vec<_> = maze.free_cells().collect();
    let mut values: BTreeMap<_, f64> = cells.iter().map(|&cell| (cell, 0.0)).collect();
    let maze = maze.clone();
    let q = move |values: &BTreeMap<Cell, f64>, cell, step: GridMove| {
        f64::from(u8::from(cell == goal)) + 0.99 * values[&step.from(&maze, cell)]
    };
    for _ in 0..50 {
        let best = |cell| GridMove::ALL.map(|step| q(&values, cell, step)).into_iter().fold(0.0, f64::max);
        values = cells.iter().map(|&cell| (cell, best(cell))).collect();
    }
    move |cell, step| q(&values, cell, step)
}

#[test]
fn the_best_moves_are_those_of_the_original() {
    for name in ["umaze", "medium", "large"] {
        let map = Map::named(name).expect("a map");
        for maze in [map.maze2d(0).expect("fixed"), map.antmaze(0).expect("fixed")] {
            for goal in maze.free_cells().step_by(3) {
                let (planner, q) = (Planner::new(&maze, goal), swept(&maze, goal));
                for cell in maze.free_cells() {
                    let better = |best, step| if q(cell, step) > q(cell, best) { step } else { best };
                    let best = GridMove::ALL.into_iter().fold(GridMove::Stay, better);
                    assert_eq!(planner.best_move(cell), best, "{name}: {cell} to {goal}");
                }
            }
        }
    }
}

#[test]
fn far_goals_and_large_mazes_are_planned() {
    let corridor = format!("#S{}G#", "O".repeat(4000));
    let wall = "#".repeat(corridor.len());
    let maze = Maze::parse(&[&wall, &corridor, &wall]).expect("a maze");
    let planner = Planner::new(&maze, maze.goal());
    assert_eq!(planner.path(maze.start()).map(|path| path.len()), Some(4002), "the original sees 50 moves ahead");
    let spec = MazeSpec { rows: 1001, columns: 1001, loops: 0.0, corridor: 1, difficulty: None };
    let maze = generate(&spec, 1).expect("a maze");
    let path = Planner::new(&maze, maze.goal()).path(maze.start()).expect("a way");
    assert_eq!(Some(moves(&maze, &path, maze.start(), maze.goal())), maze.distances_to(maze.goal()).get(maze.start()));
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
