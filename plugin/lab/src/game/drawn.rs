//! The levels of a game that somebody drew.

use super::Game;
use crate::level_files::{LevelDesigns, LevelFileError};

/// The level files of a mode, as they were when they were read last: [`LevelDesigns::of`] this game.
///
/// # Errors
///
/// The mode names no files, or one of them cannot be read or is no level of this game.
pub fn level_designs(game: &(impl Game + ?Sized), mode: &str) -> Result<LevelDesigns, LevelFileError> {
    LevelDesigns::of(game.name(), mode, &|text| game.parse_level(text))
}

/// The level files of a mode, as they are on disk now: [`LevelDesigns::read`] for this game.
///
/// # Errors
///
/// As for [`level_designs`].
pub fn read_level_designs(game: &(impl Game + ?Sized), mode: &str) -> Result<LevelDesigns, LevelFileError> {
    LevelDesigns::read(game.name(), mode, &|text| game.parse_level(text))
}
