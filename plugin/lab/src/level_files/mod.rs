//! Levels that are files, as a designer drew them.
//!
//! Their mode is the text `files:` with a pattern behind it, such as `files:levels/**/*.json`, and their numbers count the
//! files in the order of their paths. A game reads one with [`Game::parse_level`](crate::game::Game::parse_level); its Worlds
//! hold them all as [`LevelDesigns`], which the game asks before it makes a level itself.

mod design;
mod designs;
mod error;
mod find;
mod json_lines;
mod mode;
mod read;
mod text_error;

pub use design::LevelDesign;
pub use designs::LevelDesigns;
pub use error::LevelFileError;
pub use find::find_level_files;
pub use json_lines::JsonStep;
pub use mode::{LEVEL_FILES, is_level_files, level_file_pattern, level_files_mode};
pub use text_error::{LevelTextError, read_json, read_json_object};
