//! Levels as JSON: the output of `playbot level antmaze --json` for a whole mode, and level files.

use crate::{
    ant::{
        AntState,
        skeleton::{POSITIONS, VELOCITIES},
    },
    antmaze::{
        geometry::{cell_at, centre_of},
        level::AntMazeLevel,
        mode::{AntMazeMode, subject},
    },
    maze::{Cell, Map, MazeModeError, MazeSpec, read_maze},
};
use bevy_playbot::unknown_name::UnknownName;
use playbot_harness::level_files::{JsonStep::Key, LevelDesign, LevelTextError, read_json_object};
use serde::{Deserialize, Serialize};

/// The options of a mode that a level file may have. Its start and goal are drawn, so they are no options.
const RULES: [&str; 3] = ["sparse", "dense=exp", "limit=1000"];

/// Largest difference of a quaternion's length from 1.
const NEARLY: f32 = 1e-3;

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
    /// The cell whose middle is at (0, 0); the start if it is left out.
    #[serde(default)]
    origin: Option<Cell>,
    /// The goal in metres, `[x, y]`; the middle of its cell if it is left out.
    #[serde(default)]
    goal_at: Option<[f32; 2]>,
    /// The ant at the start (default: its default pose in the middle of the start).
    #[serde(default)]
    ant: Option<AntText>,
    /// Options of a mode, joined by `+`.
    #[serde(default)]
    rules: String,
}

/// Positions and velocities, as in [`AntState`].
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct AntText {
    qpos: [f32; POSITIONS],
    qvel: [f32; VELOCITIES],
}

impl LevelText {
    /// Converts a level with all fields that play needs.
    pub fn of(level: &AntMazeLevel) -> Self {
        let AntMazeLevel { maze, start, goal, goal_at, reset, pay, limit } = level;
        let drawn = maze.clone().with_any_ends(*start, *goal).unwrap_or_else(|_| maze.clone());
        let path = drawn.shortest_path();
        let rules = AntMazeMode { pay: *pay, limit: *limit, ..default_mode() }.to_string();
        Self {
            rows: drawn.to_rows(),
            start: Some(*start),
            goal: Some(*goal),
            shortest_path_length: path.len().checked_sub(1),
            origin: Some(maze.start()),
            goal_at: Some(*goal_at),
            ant: Some(AntText { qpos: reset.qpos, qvel: reset.qvel }),
            rules: rules.trim_start_matches(default_mode().map.name()).trim_start_matches('+').to_owned(),
        }
    }

    fn into_level(self, text: &str) -> Result<AntMazeLevel, LevelTextError> {
        let drawn = read_maze(text, &self.rows, self.start, self.goal)?;
        let (start, goal) = (drawn.start(), drawn.goal());
        let origin = self.origin.unwrap_or(start);
        // Coordinates begin at the start cell of the maze.
        let maze = drawn
            .with_any_ends(origin, goal)
            .map_err(|error| LevelTextError::at(text, &[Key("origin")], format!("`origin`: {error}")))?;
        let rules = rules(&self.rules)
            .map_err(|error| LevelTextError::at(text, &[Key("rules")], format!("`rules`: {error}")))?;
        let goal_at = self.goal_at.unwrap_or(centre_of(&maze, goal));
        if cell_at(&maze, goal_at) != Some(goal) {
            let what =
                format!("`goal_at` is {goal_at:?}, which is not in the goal {goal}: leave it out for its middle");
            return Err(LevelTextError::at(text, &[Key("goal_at")], what));
        }
        let reset = match self.ant {
            Some(AntText { qpos, qvel }) => AntState { qpos, qvel },
            None => {
                let mut ant = AntState::nominal();
                [ant.qpos[0], ant.qpos[1]] = centre_of(&maze, start);
                ant
            }
        };
        let at_ant = |what: String| Err(LevelTextError::at(text, &[Key("ant")], what));
        if !reset.is_finite() {
            return at_ant("`ant` has numbers that are not finite".to_owned());
        }
        let [x, y, ..] = reset.qpos;
        if cell_at(&maze, [x, y]) != Some(start) {
            return at_ant(format!(
                "`ant` is at ({x}, {y}), which is not in the start {start}: leave it out for its middle"
            ));
        }
        let length = reset.qpos[3..7].iter().map(|q| q * q).sum::<f32>().sqrt();
        if (length - 1.0).abs() > NEARLY {
            return at_ant(format!(
                "`ant` is turned by a quaternion, qpos 3 to 6, of length {length}: it has length 1"
            ));
        }
        Ok(AntMazeLevel { maze, start, goal, goal_at, reset, pay: rules.pay, limit: rules.limit })
    }
}

/// Returns the rules of generated mazes.
fn default_mode() -> AntMazeMode {
    AntMazeMode::on(Map::Random(MazeSpec::default()))
}

fn rules(text: &str) -> Result<AntMazeMode, MazeModeError> {
    let mut mode = default_mode();
    let options: Vec<&str> = text.split('+').filter(|option| !option.is_empty()).collect();
    MazeModeError::check_once(&options, subject)?;
    for option in options {
        if !RULES.iter().any(|rule| subject(rule) == subject(option)) {
            return Err(UnknownName::new("rule", option, &RULES).into());
        }
        mode.set(option)?;
    }
    Ok(mode)
}

/// Parses a level file.
///
/// # Errors
///
/// The mistake, with its line.
pub(super) fn parse(text: &str) -> Result<LevelDesign, LevelTextError> {
    let level = read_json_object::<LevelText>(text)?.into_level(text)?;
    let content = serde_json::json!(LevelText::of(&level)).to_string();
    let layout = level.maze.fingerprint();
    Ok(LevelDesign::new(level, &content).with_layout(layout))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::antmaze::mode::Pay;

    #[test]
    fn rules_are_read_as_they_are_written() {
        for (text, pay, limit) in
            [("", Pay::Distance, 1000), ("sparse", Pay::Sparse, 1000), ("dense=exp+limit=70", Pay::Exponential, 70)]
        {
            let mode = rules(text).expect("rules");
            assert_eq!((mode.pay, mode.limit), (pay, limit), "{text}");
        }
        for (text, words) in [
            ("sprse", "did you mean `sparse`?"),
            ("goals=random", "unknown rule `goals=random`"),
            ("random-start", "unknown rule"),
            ("limit=0", "at least 1"),
            ("sparse+dense=exp", "contradicts"),
        ] {
            let error = rules(text).expect_err(text).to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
