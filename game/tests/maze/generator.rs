//! Tests of the generator's promises, for any spec and seed.

use std::collections::BTreeSet;

use playbot_games::maze::{Cell, HELD_OUT_SEEDS, Maze, MazeError, MazeSpec, TRAIN_SEEDS, generate};
use proptest::prelude::*;

/// Returns the number of pairs of free cells side by side.
fn edges(maze: &Maze) -> usize {
    maze.free_cells().map(|cell| maze.neighbours(cell).count()).sum::<usize>() / 2
}

fn specs() -> impl Strategy<Value = MazeSpec> {
    (5usize..40, 5usize..40, 0.0..=1.0, 1usize..4).prop_map(|(rows, columns, loops, corridor)| {
        let least = 2 * corridor + 3;
        MazeSpec { rows: rows.max(least), columns: columns.max(least), loops, corridor, difficulty: None }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_cell_is_reached_and_the_size_is_the_one_asked_for(spec in specs(), seed: u64) {
        let maze = generate(&spec, seed).expect("a maze");
        prop_assert_eq!((maze.rows(), maze.columns()), (spec.rows, spec.columns));
        let away = maze.distances_to(maze.goal());
        prop_assert_eq!(away.reached(), maze.free_cells().count());
        prop_assert_eq!(away.get(maze.start()), Some(maze.difficulty()));
        prop_assert_eq!(&generate(&spec, seed).expect("a maze"), &maze);
        prop_assert_eq!(&Maze::parse(&maze.to_rows()).expect("its own rows"), &maze);
    }

    #[test]
    fn without_loops_there_is_one_way_and_no_longer_one(rows in 5usize..30, columns in 5usize..30, seed: u64) {
        let spec = MazeSpec { rows, columns, loops: 0.0, corridor: 1, difficulty: None };
        let maze = generate(&spec, seed).expect("a maze");
        prop_assert_eq!(edges(&maze), maze.free_cells().count() - 1);
        let longest = maze.free_cells().map(|cell| maze.distances_to(cell).farthest().1).max();
        prop_assert_eq!(Some(maze.difficulty()), longest);
    }

    #[test]
    fn loops_are_the_share_of_walls_asked_for(loops in 0.0..=1.0, seed: u64) {
        let spec = MazeSpec { rows: 17, columns: 21, loops, corridor: 1, difficulty: None };
        let maze = generate(&spec, seed).expect("a maze");
        // 8 x 10 rooms: 142 walls between them, 79 of which the tree takes.
        let cycles = edges(&maze) + 1 - maze.free_cells().count();
        prop_assert_eq!(cycles, (loops * 63.0).round() as usize);
    }

    #[test]
    fn no_cell_is_farther_from_either_end(spec in specs(), seed: u64) {
        let maze = generate(&spec, seed).expect("a maze");
        prop_assert_eq!(maze.distances_to(maze.start()).farthest().1, maze.difficulty());
        prop_assert_eq!(maze.distances_to(maze.goal()).farthest().1, maze.difficulty());
    }

    #[test]
    fn a_wanted_difficulty_is_met(least in 1usize..15, more in 0usize..5, loops in 0.0..=0.5, seed: u64) {
        let wanted = least..=least + more;
        let spec = MazeSpec { loops, difficulty: Some(wanted.clone()), ..MazeSpec::default() };
        let maze = generate(&spec, seed).expect("a maze");
        prop_assert!(wanted.contains(&maze.difficulty()), "{} is not in {wanted:?}", maze.difficulty());
    }

    #[test]
    fn corridors_are_as_wide_as_asked_for(corridor in 1usize..5, loops in 0.0..=1.0, seed: u64) {
        let side = 4 * (corridor + 1) + 1;
        let spec = MazeSpec { rows: side, columns: side, loops, corridor, difficulty: None };
        let maze = generate(&spec, seed).expect("a maze");
        // Free areas are free as a whole: rooms, and the doors between them.
        let block = |cell: Cell| (cell.row.saturating_sub(1) / (corridor + 1), cell.col.saturating_sub(1) / (corridor + 1));
        let is_post = |at: usize| at.is_multiple_of(corridor + 1);
        for cell in maze.free_cells() {
            let Cell { row, col } = cell;
            prop_assert!(!(is_post(row) && is_post(col)), "the post {cell} is free");
            let whole = maze.free_cells().filter(|other| {
                block(*other) == block(cell) && (is_post(other.row), is_post(other.col)) == (is_post(row), is_post(col))
            });
            let expected = if is_post(row) || is_post(col) { corridor } else { corridor * corridor };
            prop_assert_eq!(whole.count(), expected, "around {}", cell);
        }
    }
}

#[test]
fn the_seeds_for_the_test_give_mazes_outside_the_training() {
    let mazes = |seeds: std::ops::RangeInclusive<u64>| -> BTreeSet<Vec<String>> {
        seeds.map(|seed| generate(&MazeSpec::default(), seed).expect("a maze").to_rows()).collect()
    };
    let (train, held_out) = (mazes(TRAIN_SEEDS), mazes(HELD_OUT_SEEDS));
    assert_eq!((train.len(), held_out.len()), (64, 64), "all of them differ");
    assert!(train.is_disjoint(&held_out));
}

#[test]
fn a_maze_is_the_same_on_every_machine() {
    let maze = generate(&MazeSpec { rows: 9, columns: 9, loops: 0.2, ..MazeSpec::default() }, 7).expect("a maze");
    let rows = [
        "#########",
        "#OOOOOOO#",
        "#O#O###O#",
        "#O#OOO#O#",
        "#O###O#O#",
        "#OOO#OOO#",
        "#O#O#O#O#",
        "#OOG#O#S#",
        "#########",
    ];
    assert_eq!(maze.to_rows(), rows);
}

#[test]
fn what_cannot_be_made_is_refused_with_the_value() {
    let default = MazeSpec::default();
    let error = |spec: MazeSpec| generate(&spec, 0).expect_err("no maze");
    let nothing = MazeError::TooSmall { rows: 0, columns: 11, corridor: 1, least: 5 };
    assert_eq!(error(MazeSpec { rows: 0, ..default.clone() }), nothing);
    assert_eq!(error(MazeSpec { rows: 4097, ..default.clone() }), MazeError::TooLarge { rows: 4097, columns: 11 });
    assert_eq!(
        error(MazeSpec { rows: 4000, columns: 4000, ..default.clone() }),
        MazeError::TooLarge { rows: 4000, columns: 4000 }
    );
    let small = MazeError::TooSmall { rows: 11, columns: 11, corridor: 5, least: 13 };
    assert_eq!(error(MazeSpec { corridor: 5, ..default.clone() }), small);
    assert_eq!(error(MazeSpec { corridor: 0, ..default.clone() }), MazeError::NoCorridor);
    assert!(matches!(error(MazeSpec { corridor: usize::MAX, ..default.clone() }), MazeError::TooSmall { .. }));
    assert_eq!(error(MazeSpec { loops: -0.5, ..default.clone() }), MazeError::Loops("-0.5".to_owned()));
    let far = error(MazeSpec { difficulty: Some(1000..=2000), ..default.clone() });
    assert!(matches!(far, MazeError::Difficulty { least: 1000, most: 2000, longest } if longest > 10), "{far}");
}
