//! The games of a program, by name.

use crate::game::Game;
use bevy_playbot::unknown_name::UnknownName;
use playbot_learner::HasExitCode;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Games with distinct names, in the order given.
#[derive(Clone, Copy)]
pub struct Games<'a>(&'a [&'a dyn Game]);

/// Invalid list of games: two share a name, or it is empty.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum GamesError {
    /// Two games have the same name.
    #[error("two games are called `{0}`: give each a name of its own, which recordings and policies keep")]
    Twice(&'static str),
    /// No game was given.
    #[error("the program has no game: give it at least one")]
    None,
}

impl HasExitCode for GamesError {}

/// Kinds of files and folders that name their game.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Artifact {
    /// The folder of a run.
    Run,
    /// A policy file.
    Policy,
    /// A recording.
    Recording,
    /// An experiment, a file written by hand.
    Experiment,
    /// A finding of a test.
    Finding,
}

impl Artifact {
    fn words(self) -> &'static str {
        match self {
            Self::Run => "a run",
            Self::Policy => "a policy",
            Self::Recording => "a recording",
            Self::Experiment => "an experiment",
            Self::Finding => "a finding",
        }
    }

    fn way_out(self) -> &'static str {
        match self {
            Self::Run | Self::Policy | Self::Recording | Self::Finding => "use the program of that game",
            Self::Experiment => "correct `game` in it, or use the program of that game",
        }
    }
}

/// A file or folder of a game that the program does not have.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error(
    "{}: {} of the game `{game}`, which this program does not have (it has {}): {}",
    path.display(), kind.words(), valid.join(", "), kind.way_out()
)]
pub struct ForeignArtifact {
    /// The file or folder.
    pub path: PathBuf,
    /// Its kind.
    pub kind: Artifact,
    /// Name of its game.
    pub game: String,
    /// Names of the program's games.
    pub valid: Vec<String>,
}

impl HasExitCode for ForeignArtifact {}

/// Returns whether this is the game's name, or an [alias](Game::aliases) of it.
pub fn is_named(game: &dyn Game, name: &str) -> bool {
    game.name() == name || game.aliases().contains(&name)
}

impl<'a> Games<'a> {
    /// Checks and keeps the games.
    ///
    /// # Errors
    ///
    /// [`GamesError`] if two have the same name, or the list is empty.
    pub fn new(games: &'a [&'a dyn Game]) -> Result<Self, GamesError> {
        if games.is_empty() {
            return Err(GamesError::None);
        }
        let names: Vec<&'static str> =
            games.iter().flat_map(|game| [game.name()].into_iter().chain(game.aliases().iter().copied())).collect();
        match names.iter().enumerate().find(|(i, name)| names[..*i].contains(name)) {
            Some((_, name)) => Err(GamesError::Twice(name)),
            None => Ok(Self(games)),
        }
    }

    /// Returns the game with this name, or with this [alias](Game::aliases).
    ///
    /// # Errors
    ///
    /// [`UnknownName`] with the valid names.
    pub fn get(&self, name: &str) -> Result<&'a dyn Game, UnknownName> {
        let names: Vec<_> = self.iter().map(Game::name).collect();
        self.iter().find(|game| is_named(*game, name)).ok_or_else(|| UnknownName::new("game", name, &names))
    }

    /// Returns the game that a file or folder names.
    ///
    /// # Errors
    ///
    /// [`ForeignArtifact`] with the path, the program's games and the remedies.
    pub fn of_file(&self, kind: Artifact, path: &Path, name: &str) -> Result<&'a dyn Game, ForeignArtifact> {
        self.get(name).map_err(|unknown| ForeignArtifact {
            path: path.to_owned(),
            kind,
            game: unknown.name,
            valid: unknown.valid,
        })
    }

    /// Iterates over all games.
    pub fn iter(&self) -> impl Iterator<Item = &'a dyn Game> + use<'a> {
        self.0.iter().copied()
    }

    /// Returns the first game, the default of verbs without a game's name.
    pub fn first(&self) -> &'a dyn Game {
        self.0[0]
    }
}
