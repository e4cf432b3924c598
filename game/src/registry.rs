//! Games by name.

use bevy_playbot::game::{Game, UnknownName};

use crate::{ant::Ant, coinrun::CoinRun};

/// The games, by name.
pub const GAMES: [&str; 2] = ["coinrun", "ant"];

/// The game with this name.
///
/// # Errors
///
/// [`UnknownName`] with the valid names.
pub fn game(name: &str) -> Result<&'static dyn Game, UnknownName> {
    match name {
        "ant" => Ok(&Ant),
        "coinrun" => Ok(&CoinRun { physics: false }),
        _ => Err(UnknownName::new("game", name, &GAMES)),
    }
}
