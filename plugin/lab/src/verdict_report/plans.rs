//! Floor plans of tested levels.

use crate::{
    floor_plan::FloorPlan,
    game::Game,
    split::LevelSplit,
    verdict::{LevelVerdict, TestRecord, hash_of_files},
};

/// Floor plans of a test, if its levels can still be drawn as they were.
pub enum Plans<'a> {
    /// The game can draw them.
    Known {
        /// The game that was tested.
        game: &'a dyn Game,
        /// Its levels.
        range: &'a LevelSplit,
    },
    /// No floor plans, with the reason.
    Missing(String),
}

impl<'a> Plans<'a> {
    /// Returns the plans of a test of this game; `None` for a game that the program does not have.
    pub fn of(game: Option<&'a dyn Game>, record: &'a TestRecord) -> Self {
        let Some(game) = game else {
            return Self::Missing(format!("this program does not have the game `{}`", record.game));
        };
        let range = &record.range;
        match difference(game, record) {
            Some(why) => Self::Missing(why),
            None => Self::Known { game, range },
        }
    }

    /// Returns the plan of a level of the test.
    pub fn get(&self, level: &LevelVerdict) -> Option<FloorPlan> {
        let Self::Known { game, range } = self else { return None };
        let number = range.first.checked_add(level.index).filter(|number| *number <= range.last)?;
        game.tools().levels.floor_plan(&range.mode, number)
    }

    /// Returns the game's ticks per second; `None` without plans.
    pub fn tick_hz(&self) -> Option<f64> {
        match self {
            Self::Known { game, .. } => Some(game.tick_hz()),
            Self::Missing(_) => None,
        }
    }

    /// Returns the reason for missing plans.
    pub fn problem(&self) -> Option<&str> {
        match self {
            Self::Known { .. } => None,
            Self::Missing(why) => Some(why),
        }
    }
}

/// Describes the difference between the game's levels and the tested ones.
fn difference(game: &dyn Game, record: &TestRecord) -> Option<String> {
    if game.name() != record.game {
        return Some(format!("the levels are those of `{}`, not of `{}`", record.game, game.name()));
    }
    let (tested, now) = (record.game_version, game.version());
    if tested != now {
        return Some(format!("version {tested} of `{}` was tested, and this is version {now}", record.game));
    }
    if let Err(error) = record.range.check(game) {
        return Some(error.to_string());
    }
    let is_same = record.files == hash_of_files(game, &record.range);
    (!is_same).then(|| "the level files are not those that were tested".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict_report::testing::{Garden, level, record};

    #[test]
    fn only_levels_that_are_as_they_were_are_drawn() {
        let tested = record("hard:5..9", None);
        let plans = Plans::of(Some(&Garden), &tested);
        assert!(plans.problem().is_none() && plans.get(&level(4, 0, 1, 0)).is_some());
        assert!(plans.get(&level(5, 0, 1, 0)).is_none(), "the range has five levels");
        assert!(plans.get(&level(u64::MAX, 0, 1, 0)).is_none());
        for (record, words) in [
            (
                TestRecord { game_version: 7, ..tested.clone() },
                "version 7 of `garden` was tested, and this is version 1",
            ),
            (TestRecord { game: "maze".to_owned(), ..tested.clone() }, "those of `maze`, not of `garden`"),
            (TestRecord { files: Some("0f".to_owned()), ..tested.clone() }, "level files are not those"),
            (record("soft:0..1", None), "soft"),
        ] {
            let plans = Plans::of(Some(&Garden), &record);
            let problem = plans.problem().expect(words);
            assert!(problem.contains(words), "{problem}");
            assert!(plans.get(&level(0, 0, 1, 0)).is_none(), "{words}");
        }
        let without = Plans::of(None, &tested);
        assert_eq!(without.problem(), Some("this program does not have the game `garden`"));
    }
}
