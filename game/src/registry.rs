//! Games by name.

use bevy_playbot::game::{Game, UnknownName};

use crate::{antmaze::AntMaze, coinrun::CoinRun};

/// The games, by name.
pub const GAMES: [&str; 2] = ["coinrun", "antmaze"];

/// The game with this name.
///
/// # Errors
///
/// [`UnknownName`] with the valid names.
pub fn game(name: &str) -> Result<&'static dyn Game, UnknownName> {
    match name {
        "coinrun" => Ok(&CoinRun { physics: false }),
        "antmaze" => Ok(&AntMaze),
        _ => Err(UnknownName::new("game", name, &GAMES)),
    }
}
