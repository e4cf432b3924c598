//! Metadata of a policy file, for people and for checks.

use crate::{PictureCard, SeenLevels};
use serde::{Deserialize, Serialize};

/// Metadata of a policy: its purpose and origin.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub struct PolicyCard {
    /// Name of the game.
    pub game: String,
    /// Version of the game's rules.
    pub game_version: u32,
    /// Names of the observation's values, in order; none for images.
    pub observations: Vec<String>,
    /// Metadata of the images that it observes; `None` for vectors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<PictureCard>,
    /// Names of the discrete choices or of the action vector's dimensions; may be empty.
    pub actions: Vec<String>,
    /// Name of the algorithm.
    pub algorithm: String,
    /// A description of the training and its length.
    pub training: String,
    /// The levels that it has seen, including those of its demonstrations; `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seen: Option<SeenLevels>,
    /// Version and revision of the code that wrote the file.
    pub code: String,
}
