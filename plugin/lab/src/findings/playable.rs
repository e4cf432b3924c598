//! The check that a finding can be replayed at all.

use bevy_playbot::demo::recorder::demo_actions;
use playbot_learner::HasExitCode;
use thiserror::Error;

use super::stored::StoredFinding;
use crate::{
    game::{Game, read_level_designs},
    level_files::{LevelFileError, is_level_files},
};

/// The reason why a finding cannot be replayed, in words.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct Unplayable(pub String);

impl HasExitCode for Unplayable {}

impl StoredFinding {
    /// Checks that the game is the one that was tested, and that the level is still there.
    ///
    /// # Errors
    ///
    /// [`Unplayable`]: another game or version, other actions, a mode that the game no longer has, a level file that is
    /// gone or was changed.
    pub fn check_playable(&self, game: &dyn Game) -> Result<(), Unplayable> {
        let StoredFinding { header, episode, .. } = self;
        if header.game != game.name() {
            return Err(Unplayable(format!("it was found in the game `{}`, not in `{}`", header.game, game.name())));
        }
        if header.game_version != game.version() {
            return Err(Unplayable(format!(
                "it was found in version {} of `{}`, but this is version {}: test the level again",
                header.game_version,
                header.game,
                game.version()
            )));
        }
        let actions = demo_actions(&game.actions());
        if header.actions != actions {
            return Err(Unplayable(format!(
                "its actions are {}, but those of `{}` are {actions}",
                header.actions, header.game
            )));
        }
        if !is_level_files(&header.mode) {
            return game.check_mode(&header.mode).map_err(|error| {
                Unplayable(format!("the level no longer exists: {error}; test the levels again, or remove the finding"))
            });
        }
        let designs = read_level_designs(game, &header.mode).map_err(|error| gone(&error))?;
        match &episode.level_file {
            Some(file) => {
                let difference = designs.files().difference(episode.level_seed, file);
                difference.map_or(Ok(()), |what| Err(Unplayable(format!("{what}, or remove the finding"))))
            }
            None => Err(Unplayable("it names no level file, though its levels are files".to_owned())),
        }
    }
}

/// Returns the error of a level file that cannot be read, without the general advice about patterns.
fn gone(error: &LevelFileError) -> Unplayable {
    Unplayable(match error {
        // The file may exist relative to the folder of the test.
        LevelFileError::NoFiles { pattern, folder } => format!(
            "there is no level file {pattern}, neither seen from {folder} nor from a folder above the finding: do this from \
             the folder where the test was run, or bring the recorded file back"
        ),
        error => {
            format!("the level cannot be read any more: {error}; bring the recorded file back, or remove the finding")
        }
    })
}

#[cfg(test)]
mod tests {
    use bevy::prelude::KeyCode;

    use crate::{findings::testing::stored, foreign::ForeignGame};

    #[test]
    fn a_level_file_that_is_gone_is_told_without_patterns() {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {}).keys([vec![], vec![KeyCode::Space]]);
        let mut finding = stored();
        finding.header.mode = "files:none/gone.json".to_owned();
        let words = finding.check_playable(&game).expect_err("it is gone").to_string();
        assert!(words.starts_with("there is no level file none/gone.json, neither seen from "), "{words}");
        assert!(words.ends_with("where the test was run, or bring the recorded file back"), "{words}");
        assert!(!words.contains('*'), "{words}");
    }

    #[test]
    fn other_games_and_versions_are_named() {
        let said = |name, version| {
            let game = ForeignGame::new(name, version, |_: &mut bevy::prelude::App| {});
            stored().check_playable(&game).expect_err("another one").to_string()
        };
        assert_eq!(said("forest", 1), "it was found in the game `garden`, not in `forest`");
        assert!(said("garden", 2).starts_with("it was found in version 1 of `garden`, but this is version 2"));
        assert!(said("garden", 1).starts_with("its actions are discrete (2 actions), but"));
    }
}
