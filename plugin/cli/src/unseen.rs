//! Whether levels that are measured were seen before.

use std::path::Path;

use playbot_lab::{
    game::Game,
    held_out::{HeldOut, seen_by_training},
    split::LevelSplit,
    train::{Experiment, run_dir::RunInfo},
};
use playbot_learner::{SeenLevels, SkillModel};

use super::error::CliError;

/// The levels that players are measured on.
pub struct Measured<'a> {
    splits: Vec<HeldOut<'a>>,
    /// Somebody named them; else they are the held-out ones of the experiment.
    are_named: bool,
}

impl<'a> Measured<'a> {
    /// Ranges of levels that the game [has](LevelSplit::check).
    pub fn new(game: &'a dyn Game, splits: &'a [LevelSplit], are_named: bool) -> Self {
        Self { splits: splits.iter().map(|split| HeldOut::new(game, split)).collect(), are_named }
    }

    /// What was learned in `path` is measured on levels that it has seen only if somebody names them, who is told so.
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
                    "{path} has learned from {own}, and the held-out levels {split} have some of these: choose levels that none of \
                     the players has seen, or measure there on purpose, with --levels"
                )));
            }
            tell!(
                "{path} has learned from {own}, and the levels {split} have some of these: not all of them are unseen"
            );
        }
        Ok(())
    }
}

/// The levels that a run has seen; of runs that do not say, those that it was trained on.
pub fn seen_by_run(game: &dyn Game, experiment: &Experiment, info: &RunInfo) -> SeenLevels {
    info.seen.clone().unwrap_or_else(|| seen_by_training(game, &experiment.train))
}

/// Refuses skills in a file that were learned on levels which are held out: a file of an earlier study in the folder of this one.
///
/// # Errors
///
/// They were, with what to do.
pub fn check_skills_unseen(
    file: &Path,
    model: &SkillModel,
    game: &dyn Game,
    test: &LevelSplit,
) -> Result<(), CliError> {
    let Some(seen) = HeldOut::new(game, test).shown_by(model.demos()) else { return Ok(()) };
    Err(CliError::Usage(format!(
        "{} was learned from demonstrations of {seen}, and the held-out levels {test} have some of these: keep the runs of this study \
         in a folder of their own, with --runs",
        file.display()
    )))
}
