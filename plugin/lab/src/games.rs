//! The games of a program, by name.

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

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &'a dyn Game> + use<'a> {
        self.0.iter().copied()
    }

    /// The first one, which verbs mean where none is named.
    pub fn first(&self) -> &'a dyn Game {
        self.0[0]
    }
}
