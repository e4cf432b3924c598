//! Levels as JSON: the output of `playbot level maze2d --json` for a whole mode, and level files.

use playbot_lab::level_files::{JsonStep::Key, LevelDesign, LevelTextError, read_json_object};
use serde::{Deserialize, Serialize};

use super::{
    ball::Ball,
    level::{Maze2dLevel, centre},
    mode::Maze2dMode,
    rules_text::read_rules,
    walls::Walls,
};
use crate::maze::{Cell, read_maze};

/// A level in a file. Cells are `[row, column]`; start and goal may be letters in the rows instead.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a level: an object with `rows`, and with `start` and `goal` if the rows do not mark them"
)]
pub(super) struct LevelText {
    rows: Vec<String>,
    #[serde(default)]
    start: Option<Cell>,
    #[serde(default)]
    goal: Option<Cell>,
    /// For readers; not parsed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shortest_path_length: Option<usize>,
    /// The ball at the start, `[x, y, vx, vy]` (default: at rest in the middle of its cell).
    #[serde(default)]
    ball: Option<[f64; 4]>,
    /// Options of a mode, joined by `+` (default: the rules of generated mazes).
    #[serde(default)]
    rules: String,
}

/// A level from a file, with its rules.
#[derive(Clone, Debug)]
pub(super) struct DrawnLevel {
    pub level: Maze2dLevel,
    pub rules: Maze2dMode,
}

impl LevelText {
    /// Converts a level with all fields that play needs.
    pub fn of(level: &Maze2dLevel, rules: &Maze2dMode) -> Self {
        let Maze2dLevel { maze, start_cell, goal_cell, start, .. } = level;
        let maze = maze.clone().with_any_ends(*start_cell, *goal_cell).unwrap_or_else(|_| maze.clone());
        let path = maze.shortest_path();
        let ([x, y], [vx, vy]) = (start.position, start.velocity);
        Self {
            rows: maze.to_rows(),
            start: Some(maze.start()),
            goal: Some(maze.goal()),
            shortest_path_length: (!path.is_empty()).then(|| path.len() - 1),
            ball: Some([x, y, vx, vy]),
            rules: rules.rules_of_drawn(&maze),
        }
    }

    fn into_drawn(self, text: &str) -> Result<DrawnLevel, LevelTextError> {
        let maze = read_maze(text, &self.rows, self.start, self.goal)?;
        let rules = read_rules(text, &maze, &self.rules)?;
        let walls = Walls::new(&maze, rules.wall_offset());
        let (start_cell, goal_cell) = (maze.start(), maze.goal());
        let at_ball = |what: String| LevelTextError::at(text, &[Key("ball")], what);
        let start = match self.ball {
            None => Ball::at(centre(start_cell)),
            Some(numbers) if numbers.iter().any(|number| !number.is_finite()) => {
                return Err(at_ball(format!("`ball` is {numbers:?}: write finite numbers")));
            }
            Some([x, y, vx, vy]) => Ball { position: [x, y], velocity: [vx, vy] },
        };
        let [x, y] = start.position;
        if walls.cell_at([x, y]) != (start_cell.row as i32, start_cell.col as i32) {
            let what = format!(
                "`ball` is at ({x}, {y}), outside the start {start_cell}: x is the row and y the column of the maze; leave \
                 `ball` out for the middle of the cell"
            );
            return Err(at_ball(what));
        }
        let level = Maze2dLevel { maze, walls, start_cell, start, goal_cell };
        Ok(DrawnLevel { level, rules })
    }
}

/// Parses a level file.
///
/// # Errors
///
/// The mistake, with its line.
pub(super) fn parse(text: &str) -> Result<LevelDesign, LevelTextError> {
    let drawn = read_json_object::<LevelText>(text)?.into_drawn(text)?;
    let content = serde_json::json!(LevelText::of(&drawn.level, &drawn.rules)).to_string();
    Ok(LevelDesign::new(drawn, &content))
}
