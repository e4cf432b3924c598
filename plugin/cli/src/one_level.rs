//! One level of a game, as the command line names it.

use playbot_lab::{
    game::Game,
    split::{LevelSplit, check_level},
};

use crate::{defaults::usual_mode, error::CliError};

/// The level of verbs that play a single one.
#[derive(clap::Args, Clone, Debug)]
pub struct LevelsArg {
    /// Levels, as mode:first..last or files:pattern, such as "files:levels/*.json": the first of them, or the one that --seed
    /// names.
    #[arg(long, conflicts_with = "mode")]
    levels: Option<LevelSplit>,
}

impl LevelsArg {
    /// Whether somebody named levels.
    pub fn is_named(&self) -> bool {
        self.levels.is_some()
    }

    /// The mode that the levels name, and the level that is meant; without levels `mode`, and level 0 unless another one is
    /// named.
    ///
    /// # Errors
    ///
    /// The game does not have these levels, or the named level is none of them.
    pub fn choose<'a>(
        &'a self,
        game: &dyn Game,
        mode: Option<&'a str>,
        seed: Option<u64>,
    ) -> Result<(Option<&'a str>, u64), CliError> {
        let Some(levels) = &self.levels else {
            let level = seed.unwrap_or(0);
            check_level(game, mode.unwrap_or_else(|| usual_mode(game)), level)?;
            return Ok((mode, level));
        };
        levels.check(game)?;
        let level = seed.unwrap_or(levels.first);
        if levels.contains(&levels.mode, level) {
            return Ok((Some(levels.mode.as_str()), level));
        }
        Err(CliError::Usage(format!("--seed {level} is none of the levels {levels}")))
    }
}

#[cfg(test)]
mod tests {
    use playbot_lab::foreign::ForeignGame;

    use super::*;

    #[test]
    fn the_first_level_is_meant_unless_another_one_is_named() {
        let game = ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {});
        let levels = LevelsArg { levels: Some("default:4..9".parse().expect("levels")) };
        assert_eq!(levels.choose(&game, None, None).expect("a level"), (Some("default"), 4));
        assert_eq!(levels.choose(&game, None, Some(7)).expect("a level"), (Some("default"), 7));
        let words = levels.choose(&game, None, Some(3)).expect_err("none of them").to_string();
        assert_eq!(words, "--seed 3 is none of the levels default:4..9");
        let none = LevelsArg { levels: None };
        assert_eq!(none.choose(&game, Some("x"), Some(3)).expect("a level"), (Some("x"), 3));
        assert_eq!(none.choose(&game, None, None).expect("a level"), (None, 0));
        let other = LevelsArg { levels: Some("other:0..1".parse().expect("levels")) };
        assert!(other.choose(&game, None, None).is_err(), "the game has no such mode");
    }
}
