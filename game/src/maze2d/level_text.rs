//! Levels as JSON: the output of `playbot level maze2d --json` for a whole mode, and level files.

use crate::{
    maze::{Cell, Map, Maze, MazeModeError, MazeSpec, read_maze},
    maze2d::{
        ball::Ball,
        level::{Maze2dLevel, centre},
        mode::{Maze2dMode, subject},
        walls::Walls,
    },
};
use bevy_playbot::unknown_name::UnknownName;
use playbot_harness::level_files::{JsonStep::Key, LevelDesign, LevelTextError, read_json_object};
use serde::{Deserialize, Serialize};

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
    let layout = drawn.level.maze.fingerprint();
    Ok(LevelDesign::new(drawn, &content).with_layout(layout))
}

// The rules of a level file, as text: options of a mode without its map.

/// The options that a level file may have. Its start and goal are drawn, so they are no options.
const RULES: [&str; 6] = ["sparse", "limit=1000", "end-at-goal", "no-offset", "contact=rapier", "retarget"];

impl Maze2dMode {
    /// Returns the rules of a drawn maze: those of generated mazes of its size, with these options.
    fn of_drawn(maze: &Maze, options: &str) -> Result<Self, MazeModeError> {
        let mut mode = Self::new(drawn_map(maze));
        let options: Vec<&str> = options.split('+').filter(|option| !option.is_empty()).collect();
        MazeModeError::check_once(&options, subject)?;
        for option in options {
            if !RULES.iter().any(|rule| subject(rule) == subject(option)) {
                return Err(UnknownName::new("rule", option, &RULES).into());
            }
            mode.set(option)?;
        }
        mode.check_together()?;
        Ok(mode)
    }

    /// Returns the options with which a level file of this maze has the rules of this mode.
    pub(super) fn rules_of_drawn(&self, maze: &Maze) -> String {
        let drawn = Self { map: drawn_map(maze), fixed_start: false, random_goal: false, ..self.clone() };
        drawn.options().join("+")
    }
}

/// Returns the map of a generated maze of this size, which decides the default limit.
fn drawn_map(maze: &Maze) -> Map {
    Map::Random(MazeSpec { rows: maze.rows(), columns: maze.columns(), ..MazeSpec::default() })
}

/// Parses the rules of a level file.
///
/// # Errors
///
/// The mistake, with its line.
pub(super) fn read_rules(text: &str, maze: &Maze, options: &str) -> Result<Maze2dMode, LevelTextError> {
    Maze2dMode::of_drawn(maze, options)
        .map_err(|error| LevelTextError::at(text, &[Key("rules")], format!("`rules`: {error}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maze2d::mode::ContactModel;

    fn maze() -> Maze {
        Maze::parse(&["####", "#SG#", "####"]).expect("a maze")
    }

    #[test]
    fn rules_are_those_of_generated_mazes_of_the_size_with_what_is_written() {
        let plain = Maze2dMode::of_drawn(&maze(), "").expect("rules");
        assert_eq!((plain.limit, plain.sparse, plain.fixed_start), (300, false, false));
        let mode =
            Maze2dMode::of_drawn(&maze(), "sparse+limit=40+contact=rapier+no-offset+end-at-goal").expect("rules");
        assert_eq!((mode.limit, mode.sparse, mode.contact, mode.offset), (40, true, ContactModel::Rapier, false));
        assert_eq!(mode.rules_of_drawn(&maze()), "sparse+limit=40+end-at-goal+no-offset+contact=rapier");
        let medium: Maze2dMode = "medium+goal=random+fixed-start".parse().expect("a mode");
        assert_eq!(medium.rules_of_drawn(&maze()), "limit=600");
    }

    #[test]
    fn what_is_no_rule_is_named() {
        for (rules, words) in [
            ("sprse", "did you mean `sparse`?"),
            ("goal=random", "unknown rule `goal=random`"),
            ("fixed-start", "unknown rule"),
            ("size=9x9", "unknown rule"),
            ("limit=0", "at least 1"),
            ("sparse+sparse", "repeats"),
            ("retarget+end-at-goal", "leave out end-at-goal"),
        ] {
            let error = Maze2dMode::of_drawn(&maze(), rules).expect_err(rules).to_string();
            assert!(error.contains(words), "{rules}: {error}");
        }
        let error = read_rules("{\n\n\"rules\": \"x\"}", &maze(), "x").expect_err("no rule");
        assert_eq!(error.line, Some(3));
    }
}
