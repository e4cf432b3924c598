//! Planted defects: games and levels that are broken on purpose, to measure which testers find them. A level or game
//! without one is called *unmutated*; reports and files call such levels *sound levels*.
//!
//! - A [`DefectKind`] says how a defect is planted, into a level or into the rules of a game. Every game has
//!   [general ones](general_defects), and those of its own
//!   [`TestTools::defects`](playbot_harness::game::TestTools::defects): [`defect_kinds`].
//! - A [`Mutant`] is a game with one of them in its rules.
//! - [`make_bugs`] plants a [`BugSet`], which is kept in a folder and reproducible from a seed.
//! - [`score`](crate::score) measures which testers find them.
//!
//! The folder, in reading order:
//!
//! - `general`: the defects of rules that fit any game.
//! - `mutant`: games with a defect in their rules, and levels with a place for one.
//! - `make`: the planting of defects into the games of a program.
//! - `set`: sets of planted defects, in memory and as files.

mod general;
mod make;
mod mutant;
mod set;

use playbot_harness::{
    defect::DefectKind, eval::EvalError, game::Game, inspect::InspectError, level_files::LevelFileError,
    mode::ModeError, sealed_file::SealedFileError,
};
use playbot_learner::HasExitCode;
use playbot_report::counted;
use std::path::PathBuf;
use thiserror::Error;

pub use crate::bugs::{
    general::general_defects,
    make::{Made, MakePlan, MissingMutants, Source, make_bugs, without_effect},
    mutant::{Mutant, PlantedRules},
    set::{BugGame, BugSet, PlantedBug, PlantedPart, UnmutatedLevels},
};

/// Returns the game's own defects, and the general ones. A class of the game's own replaces a general one.
pub fn defect_kinds(game: &dyn Game) -> Vec<DefectKind> {
    let mut kinds = game.tools().tests.defects();
    let is_own = |class: &str| kinds.iter().any(|kind| kind.class == class);
    let general: Vec<_> = general_defects(game).into_iter().filter(|kind| !is_own(kind.class)).collect();
    kinds.extend(general);
    kinds
}

/// The reason why defects cannot be planted, or a set of them cannot be used.
#[derive(Debug, Error)]
pub enum BugError {
    /// The folder already has a set.
    #[error("{} has planted defects already: choose another --out, or replace them with --force", .0.display())]
    Exists(PathBuf),
    /// The folder is that of a test.
    #[error("{} has the results of a test: choose another --out", .0.display())]
    IsTest(PathBuf),
    /// The folder has no set.
    #[error("{} has no mutants.json: name a folder that `playbot bugs make --out FOLDER` has made", .0.display())]
    Missing(PathBuf),
    /// A file has an invalid line.
    #[error("{}, line {line}: {what}; make the set again with `playbot bugs make`", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The error.
        what: String,
    },
    /// The set was made for another version of the game.
    #[error(
        "{}: the defects of `{game}` were planted into its version {made}, and this program has version {is}: make the set \
         again with `playbot bugs make`", path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// The game.
        game: String,
        /// The version in the set.
        made: u32,
        /// The program's.
        is: u32,
    },
    /// A game has no level that defects can be planted into.
    #[error(
        "`{game}`: none of the levels {levels} is held out from training and played to a good end by its bot \
         `{bot}`: name others with --levels {game}=MODE:first..last"
    )]
    NoBase {
        /// The game.
        game: String,
        /// The levels.
        levels: String,
        /// Its demonstrator.
        bot: String,
    },
    /// There are fewer unmutated levels than needed.
    #[error(
        "`{game}`: {levels} has {}, and {wanted} are needed: name more with --levels {game}=MODE:first..last, or \
         ask for fewer with --sound and --per-kind", counted(*count, "sound level")
    )]
    TooFewLevels {
        /// The game.
        game: String,
        /// The levels.
        levels: String,
        /// Number of unmutated levels among them.
        count: u64,
        /// Number of unmutated levels that are needed.
        wanted: u64,
    },
    /// A kind of defect makes an invalid level.
    #[error("the defect `{class}` of `{game}` turned {base} into an invalid level: {why}")]
    NoLevel {
        /// The game.
        game: String,
        /// The class of the defect.
        class: String,
        /// The level, as `MODE:N`.
        base: String,
        /// The reason.
        why: String,
    },
    /// A file of the set cannot be read or written.
    #[error(transparent)]
    File(#[from] SealedFileError),
    /// The game does not have the levels.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// The unmutated levels cannot be played.
    #[error(transparent)]
    Eval(#[from] EvalError),
    /// A level cannot be printed.
    #[error(transparent)]
    Inspect(#[from] InspectError),
    /// A level file cannot be read.
    #[error(transparent)]
    Level(#[from] LevelFileError),
}

impl HasExitCode for BugError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::File(error) => error.exit_code(),
            Self::NoLevel { .. } | Self::Eval(EvalError::Fault(_)) => 2,
            _ => 3,
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::App;

    use super::*;
    use playbot_harness::foreign::ForeignGame;

    #[test]
    fn an_own_class_takes_the_place_of_a_general_one() {
        let game = ForeignGame::new("ball", 1, |_: &mut App| {})
            .defect(DefectKind::rules("sticky-floor", "the ball sticks", 1, |_, _| {}))
            .defect(DefectKind::rules("panic", "the ball bursts", 2, |_, _| {}));
        let kinds = defect_kinds(&game);
        assert_eq!((kinds[0].class, kinds[1].about), ("sticky-floor", "the ball bursts"));
        assert_eq!(kinds.iter().filter(|kind| kind.class == "panic").count(), 1);
        assert_eq!(kinds.len(), general_defects(&game).len() + 1);
    }
}
