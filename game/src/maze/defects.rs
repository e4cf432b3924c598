//! Shared defects of the games in mazes: see `playbot_mutation`.

use crate::maze::{Cell, Maze, planner::prove};
use bevy::{
    prelude::*,
    reflect::{GetPath, enums::DynamicEnum},
};
use playbot_harness::{
    defect::{DefectKind, PLACES, place},
    prelude::*,
};
use playbot_learner::rng::{ChaCha8Rng, shuffle};
use serde::Deserialize;
use serde_json::Value;

/// Makes another maze for the rules, by start, goal and variant; `None` where the defect has no suitable position.
pub(crate) type ChangeMaze = fn(&Maze, Cell, Cell, u32) -> Option<Maze>;

/// Returns the defects of the walls of a game; `stand` gives its rules another maze as soon as a level has been built.
pub(crate) fn of_walls(stand: fn(&mut App, u32, ChangeMaze)) -> Vec<DefectKind> {
    let kind = |class, about, change: ChangeMaze| {
        DefectKind::rules(class, about, PLACES, move |app: &mut App, variant: u32| stand(app, variant, change))
    };
    vec![
        kind("invisible-wall", "an empty cell blocks players", walled_on_the_way),
        kind("missing-collider", "a wall can be gone through", wall_gone_beside_the_way),
    ]
}

/// Lets an episode go on whose goal was reached in this tick. No game can do that; reflection can.
pub(crate) fn take_back(episode: &mut Episode) {
    if let Ok(reached) = episode.path_mut::<bool>("reached") {
        *reached = false;
    }
    if !episode.end().is_some_and(EpisodeEnd::is_success) {
        return;
    }
    if let Ok(state) = episode.reflect_path_mut("state") {
        // If the fields of episodes change, the test below fails.
        let _ = state.try_apply(&DynamicEnum::new("Running", ()));
    }
}

// Defects of levels that are mazes: walls on every path to the goal.

/// The maze within a level's text.
#[derive(Deserialize)]
struct Drawn {
    rows: Vec<String>,
    #[serde(default)]
    start: Option<Cell>,
    #[serde(default)]
    goal: Option<Cell>,
}

/// Puts walls into a maze until no path leads to its goal; `None` if it has no suitable position.
type Close = fn(&Maze, &mut ChaCha8Rng) -> Option<Maze>;

/// Returns the defects of levels of a game with such texts; `reads` returns whether a text is a level.
pub(crate) fn of_levels(reads: fn(&str) -> bool) -> Vec<DefectKind> {
    let kind = |class, about, close: Close| {
        DefectKind::level(class, about, move |text: &str, rng: &mut ChaCha8Rng| {
            closed(text, rng, close).filter(|text| reads(text))
        })
    };
    vec![
        kind("sealed-goal", "walls on all sides of the goal", |maze, _| sealed(maze, maze.goal())),
        kind("sealed-start", "walls on all sides of the start", |maze, _| sealed(maze, maze.start())),
        kind("walled-way", "a wall across the only path to the goal", walled_way),
    ]
}

fn closed(text: &str, rng: &mut ChaCha8Rng, close: Close) -> Option<String> {
    let Drawn { rows, start, goal } = serde_json::from_str(text).ok()?;
    let maze = Maze::parse_drawn(&rows, start, goal).ok()?;
    let closed = close(&maze, rng)?;
    // Only a proof by a search over all cells makes a level broken for certain.
    prove(&closed, closed.start(), closed.goal()).why_unsolvable()?;
    let mut level: Value = serde_json::from_str(text).ok()?;
    let fields = level.as_object_mut()?;
    fields.insert("rows".to_owned(), serde_json::json!(closed.to_rows()));
    // There is no path any more.
    fields.remove("shortest_path_length");
    Some(level.to_string())
}

/// Puts walls in all eight cells around one, so that nothing slips through at a corner either. The cell itself stays
/// free. So do start and goal; `None` where they touch it.
fn sealed(maze: &Maze, cell: Cell) -> Option<Maze> {
    let around =
        (cell.row - 1..=cell.row + 1).flat_map(|row| (cell.col - 1..=cell.col + 1).map(move |col| Cell { row, col }));
    let free: Vec<Cell> = around.filter(|&near| near != cell && maze.is_free(near)).collect();
    if free.is_empty() || maze.start() == maze.goal() {
        return None;
    }
    free.into_iter().try_fold(maze.clone(), |maze, near| redrawn(&maze, near, '#'))
}

/// Puts a wall on the shortest path, in a cell on every path.
fn walled_way(maze: &Maze, rng: &mut ChaCha8Rng) -> Option<Maze> {
    let path = maze.shortest_path();
    let mut between = path.get(1..path.len().checked_sub(1)?)?.to_vec();
    shuffle(&mut between, rng);
    let mut walled = between.into_iter().filter_map(|cell| redrawn(maze, cell, '#'));
    walled.find(|maze| prove(maze, maze.start(), maze.goal()).why_unsolvable().is_some())
}

// Mazes with another wall, or with one less.

/// Returns the maze with one more wall, on the shortest path from one cell to another; `None` if the path has no cell
/// between.
fn walled_on_the_way(maze: &Maze, start: Cell, goal: Cell, variant: u32) -> Option<Maze> {
    let path = maze.shortest_path_between(start, goal)?;
    let last = path.len().checked_sub(2).filter(|&last| last > 0)?;
    redrawn(maze, path[on_the_way(variant, path.len()).clamp(1, last)], '#')
}

/// Returns the maze without one of its walls: one between two free cells, the first from the variant's place on along
/// the path.
fn wall_gone_beside_the_way(maze: &Maze, start: Cell, goal: Cell, variant: u32) -> Option<Maze> {
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
fn redrawn(maze: &Maze, cell: Cell, letter: char) -> Option<Maze> {
    let mut rows: Vec<Vec<char>> = maze.to_rows().iter().map(|row| row.chars().collect()).collect();
    *rows.get_mut(cell.row)?.get_mut(cell.col)? = letter;
    let rows: Vec<String> = rows.into_iter().map(String::from_iter).collect();
    Maze::parse_drawn(&rows, Some(maze.start()), Some(maze.goal())).ok()
}

#[cfg(test)]
mod tests {
    use playbot_harness::defect::Plant;
    use playbot_learner::rng::Streams;

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

    fn planted(class: &str, rows: &[&str]) -> Option<Maze> {
        let kind = of_levels(|_| true).into_iter().find(|kind| kind.class == class).expect("there is such a defect");
        let Plant::Level(change) = kind.plant else { panic!("`{class}` is one of levels") };
        let text = serde_json::json!({ "rows": rows, "shortest_path_length": 9 }).to_string();
        let text = change(&text, &mut Streams::new(1).stream("test", 0))?;
        let Drawn { rows, start, goal } = serde_json::from_str(&text).expect("a level");
        assert!(!text.contains("shortest"), "{text}");
        Some(Maze::parse_drawn(&rows, start, goal).expect("a maze"))
    }

    const LOOP: [&str; 6] = ["########", "#SOOOOO#", "#O####O#", "#O####O#", "#OOOOOG#", "########"];

    #[test]
    fn goal_and_start_are_walled_in_on_all_sides() {
        let sealed = planted("sealed-goal", &LOOP).expect("there is room");
        let rows = ["########", "#SOOOOO#", "#O####O#", "#O######", "#OOOO#G#", "########"];
        assert_eq!(sealed.to_rows(), rows);
        let sealed = planted("sealed-start", &LOOP).expect("there is room");
        assert_eq!(sealed.neighbours(sealed.start()).count(), 0);
        assert_eq!(planted("sealed-goal", &["####", "#SG#", "####"]), None, "they touch");
    }

    #[test]
    fn a_way_is_walled_where_there_is_no_other() {
        assert_eq!(planted("walled-way", &LOOP), None, "it leads around");
        let walled = planted("walled-way", &["#######", "#SOOOG#", "#######"]).expect("there is room");
        assert!(walled.shortest_path().is_empty());
    }

    #[test]
    fn an_episode_that_was_won_goes_on_and_one_that_was_lost_does_not() {
        let mut app = headless_app();
        let agent = Agent::new(0, ActionSpace::Discrete(2));
        let agent = app.world_mut().spawn((agent, Control::Human, LevelQueue::Always(0))).id();
        app.tick().expect("sound");
        let mut episode = app.world().get::<Episode>(agent).expect("every agent has one").clone();
        episode.reach();
        episode.terminate(true);
        assert!(episode.is_success());
        take_back(&mut episode);
        assert_eq!((episode.is_running(), episode.end(), episode.is_success()), (true, None, false));
        episode.terminate(false);
        take_back(&mut episode);
        assert_eq!(episode.end(), Some(EpisodeEnd::LOST));
    }
}
