//! Levels from files, as drawn by a designer.
//!
//! Their mode is the text `files:` followed by a pattern, such as `files:levels/**/*.json`. Their numbers count the
//! files in the order of their paths. A game reads a file with [`Game::parse_level`](crate::game::Game::parse_level).
//! Its Worlds hold all files as [`LevelDesigns`], where the game looks before it makes a level itself.

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
