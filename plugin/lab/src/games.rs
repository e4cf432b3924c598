//! The games of a program, by name.

use std::path::{Path, PathBuf};

use bevy_playbot::unknown_name::UnknownName;
use thiserror::Error;

use crate::game::Game;

/// Games with different names, in the order in which they were given.
#[derive(Clone, Copy)]
pub struct Games<'a>(&'a [&'a dyn Game]);

/// The games of a program cannot be told apart, or there are none.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum GamesError {
    /// Two games have the same name.
    #[error("two games are called `{0}`: give each a name of its own, which recordings and policies keep")]
    Twice(&'static str),
    /// No game was given.
    #[error("the program has no game: hand it at least one")]
    None,
}

/// A file or folder that names the game it is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Artifact {
    /// The folder of a run.
    Run,
    /// A policy file.
    Policy,
    /// A recording.
    Recording,
    /// An experiment, which people write.
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

/// A file or folder is of a game that the program does not have.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error(
    "{}: {} of the game `{game}`, which this program does not have (it has {}): {}",
    path.display(), kind.words(), valid.join(", "), kind.way_out()
)]
pub struct ForeignArtifact {
    /// The file or folder.
    pub path: PathBuf,
    /// What it is.
    pub kind: Artifact,
    /// The game that it names.
    pub game: String,
    /// The games of the program.
    pub valid: Vec<String>,
}

impl<'a> Games<'a> {
    /// These games.
    ///
    /// # Errors
    ///
    /// [`GamesError`] if two have the same name, or there are none.
    pub fn new(games: &'a [&'a dyn Game]) -> Result<Self, GamesError> {
        if games.is_empty() {
            return Err(GamesError::None);
        }
        let twice =
            games.iter().enumerate().find(|(i, game)| games[..*i].iter().any(|other| other.name() == game.name()));
        match twice {
            Some((_, game)) => Err(GamesError::Twice(game.name())),
            None => Ok(Self(games)),
        }
    }

    /// The game with this name.
    ///
    /// # Errors
    ///
    /// [`UnknownName`] with the valid names.
    pub fn get(&self, name: &str) -> Result<&'a dyn Game, UnknownName> {
        let names: Vec<_> = self.iter().map(Game::name).collect();
        self.iter().find(|game| game.name() == name).ok_or_else(|| UnknownName::new("game", name, &names))
    }

    /// The game that a file or folder names.
    ///
    /// # Errors
    ///
    /// [`ForeignArtifact`] with the path, the program's games and what can be done.
    pub fn of_file(&self, kind: Artifact, path: &Path, name: &str) -> Result<&'a dyn Game, ForeignArtifact> {
        self.get(name).map_err(|unknown| ForeignArtifact {
            path: path.to_owned(),
            kind,
            game: unknown.name,
            valid: unknown.valid,
        })
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &'a dyn Game> + use<'a> {
        self.0.iter().copied()
    }

    /// The first one, which verbs mean where none is named.
    pub fn first(&self) -> &'a dyn Game {
        self.0[0]
    }
}
