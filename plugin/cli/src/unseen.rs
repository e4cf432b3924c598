//! Check that measured levels were not learned from.

use std::path::Path;

use playbot_lab::{
    game::Game,
    held_out::{HeldOut, seen_by_training},
    split::LevelSplit,
    train::{Experiment, run_dir::RunInfo},
};
use playbot_learner::SeenLevels;

use super::error::CliError;

/// The levels that players are measured on.
pub struct Measured<'a> {
    splits: Vec<HeldOut<'a>>,
    /// The levels were named; else they are the held-out ones of the experiment.
    are_named: bool,
}

impl<'a> Measured<'a> {
    /// Takes ranges of levels that the game [has](LevelSplit::check).
    pub fn new(game: &'a dyn Game, splits: &'a [LevelSplit], are_named: bool) -> Self {
        Self { splits: splits.iter().map(|split| HeldOut::new(game, split)).collect(), are_named }
    }

    /// Checks that the policy in `path` has not learned from these levels. Levels that were named are only reported.
    ///
    /// # Errors
    ///
    /// It has seen held-out levels.
    pub fn check(&self, path: &Path, seen: Option<&SeenLevels>) -> Result<(), CliError> {
        for levels in &self.splits {
            let Some(own) = levels.shown_by(seen) else { continue };
            let (path, split) = (path.display(), levels.split());
            if !self.are_named {
                return Err(CliError::Usage(format!(
                    "{path} has learned from {own}, and the held-out levels {split} have some of these: choose \
                     levels that no player has seen, or measure there on purpose, with --levels"
                )));
            }
            tell!(
                "{path} has learned from {own}, and the levels {split} have some of these: not all of them are unseen"
            );
        }
        Ok(())
    }
}

/// Returns the levels that a run has seen; for runs without a note, its training levels.
pub fn seen_by_run(game: &dyn Game, experiment: &Experiment, info: &RunInfo) -> SeenLevels {
    info.seen.clone().unwrap_or_else(|| seen_by_training(game, &experiment.train))
}
