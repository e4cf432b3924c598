//! Options for one level of a game.

use playbot_lab::{
    game::Game,
    split::{LevelSplit, check_level},
};

use crate::{defaults::usual_mode, error::CliError};

/// The level of verbs that play a single one.
#[derive(clap::Args, Clone, Debug)]
pub struct LevelsArg {
    /// Levels, as mode:first..last or files:pattern, such as "files:levels/*.json". The first of them is taken, or the
    /// one of --level.
    #[arg(long, conflicts_with = "mode")]
    levels: Option<LevelSplit>,
    /// Number of the level (default: 0, or the first of the levels).
    #[arg(long, value_name = "N")]
    level: Option<u64>,
}

/// Returns the number of the level. Up to version 0.1 it was named by --seed in verbs that play a single level: alone
/// it still is, with a warning.
pub fn level_number(level: Option<u64>, seed: Option<u64>) -> Option<u64> {
    if let (None, Some(seed)) = (level, seed) {
        tell!(
            "warning: --seed {seed} is taken as the level, which the next version will not do: --seed names the random \
             seed; for a level use --level {seed}"
        );
    }
    level.or(seed)
}

impl LevelsArg {
    /// Returns true if levels are named, and with them their mode.
    pub fn is_named(&self) -> bool {
        self.levels.is_some()
    }

    /// Returns the number of the level if one is named: by --level, or by `seed`, the value of --seed.
    pub fn number(&self, seed: Option<u64>) -> Option<u64> {
        level_number(self.level, seed)
    }

    /// Returns the random seed for the value of --seed, which names the level instead where no --level is given.
    pub fn random_seed(&self, seed: Option<u64>) -> u64 {
        self.level.and(seed).unwrap_or(0)
    }

    /// Returns the mode and the level to play. Without levels these are `mode`, and level 0 unless another one is
    /// named by --level, or by `seed`, the value of --seed.
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
            let level = self.number(seed).unwrap_or(0);
            check_level(game, mode.unwrap_or_else(|| usual_mode(game)), level)?;
            return Ok((mode, level));
        };
        levels.check(game)?;
        let level = self.number(seed).unwrap_or(levels.first);
        if levels.contains(&levels.mode, level) {
            return Ok((Some(levels.mode.as_str()), level));
        }
        Err(CliError::Usage(format!("--level {level} is none of the levels {levels}")))
    }
}

#[cfg(test)]
mod tests {
    use playbot_lab::foreign::ForeignGame;

    use super::*;

    #[test]
    fn the_first_level_is_meant_unless_another_one_is_named() {
        let game = ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {});
        let named =
            |levels: Option<&str>, level| LevelsArg { levels: levels.map(|it| it.parse().expect("levels")), level };
        let chosen = |levels, level, seed| {
            let args = named(levels, level);
            args.choose(&game, None, seed)
                .map(|(mode, level)| (mode.map(str::to_owned), level))
                .map_err(|it| it.to_string())
        };
        let (range, default) = (Some("default:4..9"), Some("default".to_owned()));
        assert_eq!(chosen(range, None, None), Ok((default.clone(), 4)));
        assert_eq!(chosen(range, Some(7), None), Ok((default.clone(), 7)));
        assert_eq!(chosen(range, None, Some(7)), Ok((default.clone(), 7)), "as it was up to version 0.1");
        assert_eq!(chosen(range, Some(8), Some(7)), Ok((default, 8)));
        assert_eq!(chosen(range, Some(3), None), Err("--level 3 is none of the levels default:4..9".to_owned()));
        assert_eq!(named(None, None).choose(&game, Some("x"), Some(3)).expect("a level"), (Some("x"), 3));
        assert_eq!(chosen(None, None, None), Ok((None, 0)));
        assert!(chosen(Some("other:0..1"), None, None).is_err(), "the game has no such mode");
        assert_eq!(named(None, Some(3)).random_seed(Some(7)), 7);
        assert_eq!(named(None, Some(3)).random_seed(None), 0);
        assert_eq!(named(None, None).random_seed(Some(7)), 0, "it names the level");
    }
}
