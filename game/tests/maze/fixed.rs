//! Tests of the fixed maps against the original sources.

use playbot_games::maze::{Cell, Map, Maze};
use serde::Deserialize;

#[derive(Deserialize)]
pub struct Golden {
    maps: Vec<GoldenMap>,
    pub shortest_paths: Vec<GoldenPaths>,
}

#[derive(Deserialize)]
struct GoldenMap {
    id: String,
    kind: String,
    wall: char,
    rows: Vec<String>,
    goal: Cell,
    free_cells: usize,
    longest_shortest_path_cells: usize,
    start_goal_path_cells: Option<usize>,
    demo_goals: Option<Vec<Cell>>,
}

#[derive(Deserialize)]
pub struct GoldenPaths {
    pub id: String,
    pub pairs: Vec<(Cell, Cell, usize)>,
}

pub fn golden() -> Golden {
    crate::golden::json("maze/maze_maps.json")
}

/// Returns the map with a golden id such as `antmaze-medium`.
pub fn by_id(id: &str) -> Maze {
    let (game, name) = id.split_once('-').expect("game and name");
    let map = Map::named(name).expect("a map");
    let maze = if game == "antmaze" { map.antmaze(0) } else { map.maze2d(0) };
    maze.expect("fixed")
}

#[test]
fn walls_and_goals_are_the_golden_ones() {
    let maps = golden().maps;
    assert!(!maps.is_empty());
    for map in maps {
        let maze = by_id(&map.id);
        let walls: Vec<String> = map.rows.iter().map(|row| row.replace(|c| c != map.wall, " ")).collect();
        let ours: Vec<String> = maze.to_rows().iter().map(|row| row.replace(|c| c != '#', " ")).collect();
        assert_eq!(ours, walls.iter().map(|row| row.replace(map.wall, "#")).collect::<Vec<_>>(), "{}", map.id);
        assert_eq!((maze.goal(), maze.free_cells().count()), (map.goal, map.free_cells), "{}", map.id);
        let longest = maze.free_cells().map(|cell| maze.distances_to(cell).farthest().1).max();
        assert_eq!(longest, Some(map.longest_shortest_path_cells), "{}", map.id);
        if map.kind == "antmaze" {
            assert_eq!(maze, Maze::parse(&map.rows).expect("D4RL's letters"), "{}", map.id);
            assert_eq!(Some(maze.difficulty()), map.start_goal_path_cells, "{}", map.id);
        }
        let Some(golden_goals) = map.demo_goals else { continue };
        let demo_goals: &[Cell] = match map.id.as_str() {
            "antmaze-umaze" => &playbot_games::maze::fixed::antmaze::UMAZE_DEMO_GOALS,
            "antmaze-medium" => &playbot_games::maze::fixed::antmaze::MEDIUM_DEMO_GOALS,
            "antmaze-large" => &playbot_games::maze::fixed::antmaze::LARGE_DEMO_GOALS,
            "antmaze-xl" => &playbot_games::maze::fixed::antmaze::XL_DEMO_GOALS,
            _ => &[],
        };
        assert_eq!(demo_goals, golden_goals, "{}", map.id);
        assert!(demo_goals.iter().all(|&cell| maze.is_free(cell)), "{}", map.id);
    }
}

#[test]
fn every_map_of_both_games_can_be_played() {
    for name in Map::NAMES {
        let map = Map::named(name).expect("a map");
        for maze in [map.maze2d(3), map.antmaze(3)] {
            let maze = maze.expect("playable");
            assert_eq!(maze.distances_to(maze.goal()).reached(), maze.free_cells().count(), "{name} has pockets");
            assert!(maze.difficulty() >= 6, "{name}");
        }
    }
    let umaze = playbot_games::maze::fixed::antmaze::umaze();
    assert!(playbot_games::maze::fixed::antmaze::UMAZE_DEMO_GOALS.iter().all(|&cell| umaze.is_free(cell)));
}
