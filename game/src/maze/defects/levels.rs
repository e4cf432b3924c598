//! Defects of levels that are mazes: walls on every path to the goal.

use playbot_lab::defect::DefectKind;
use playbot_learner::rng::{ChaCha8Rng, shuffle};
use serde::Deserialize;
use serde_json::Value;

use super::cells::redrawn;
use crate::maze::{Cell, Maze, proof::prove};

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

/// Returns the defects of levels of a game with such texts; `reads` tells whether a text is a level.
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

#[cfg(test)]
mod tests {
    use playbot_lab::defect::Plant;
    use playbot_learner::rng::Streams;

    use super::*;

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
}
