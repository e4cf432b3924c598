//! Games by name.

use bevy_playbot::game::{Game, UnknownName};

use crate::coinrun::CoinRun;

/// The games, by name.
pub const GAMES: [&str; 1] = ["coinrun"];

/// The game with this name.
///
/// # Errors
///
/// [`UnknownName`] with the valid names.
pub fn game(name: &str) -> Result<&'static dyn Game, UnknownName> {
    match name {
        "coinrun" => Ok(&CoinRun { physics: false }),
        _ => Err(UnknownName::new("game", name, &GAMES)),
    }
}
