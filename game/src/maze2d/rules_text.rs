//! The rules of a level file, as text: options of a mode without its map.

use playbot_lab::level_files::{JsonStep::Key, LevelTextError};

use bevy_playbot::unknown_name::UnknownName;

use super::mode::{Maze2dMode, subject};
use crate::maze::{Map, Maze, MazeModeError, MazeSpec};

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
    use crate::maze2d::mode::Contact;

    fn maze() -> Maze {
        Maze::parse(&["####", "#SG#", "####"]).expect("a maze")
    }

    #[test]
    fn rules_are_those_of_generated_mazes_of_the_size_with_what_is_written() {
        let plain = Maze2dMode::of_drawn(&maze(), "").expect("rules");
        assert_eq!((plain.limit, plain.sparse, plain.fixed_start), (300, false, false));
        let mode =
            Maze2dMode::of_drawn(&maze(), "sparse+limit=40+contact=rapier+no-offset+end-at-goal").expect("rules");
        assert_eq!((mode.limit, mode.sparse, mode.contact, mode.offset), (40, true, Contact::Rapier, false));
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
