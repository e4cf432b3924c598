//! Games by name.

use bevy_playbot::game::{Game, UnknownName};

use crate::{ant::Ant, antmaze::AntMaze, coinrun::CoinRun, maze2d::Maze2d, sighted::Sighted};

/// The games, by name.
pub const GAMES: [&str; 6] = ["coinrun", "maze2d", "maze2d-sighted", "ant", "antmaze", "antmaze-sighted"];

/// The game with this name.
///
/// # Errors
///
/// [`UnknownName`] with the valid names.
pub fn game(name: &str) -> Result<&'static dyn Game, UnknownName> {
    match name {
        "coinrun" => Ok(&CoinRun { physics: false }),
        "maze2d" => Ok(&Maze2d { physics: false }),
        "maze2d-sighted" => Ok(&Sighted(Maze2d { physics: false })),
        "ant" => Ok(&Ant),
        "antmaze" => Ok(&AntMaze),
        "antmaze-sighted" => Ok(&Sighted(AntMaze)),
        _ => Err(UnknownName::new("game", name, &GAMES)),
    }
}
