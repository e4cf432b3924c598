//! What a policy file says about itself to people.

use crate::{PictureCard, SeenLevels};
use serde::{Deserialize, Serialize};

/// What a policy was made for and by, for people and for checks.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub struct PolicyCard {
    /// Name of the game.
    pub game: String,
    /// Version of the game's rules.
    pub game_version: u32,
    /// Names of the observation's values, in order; none for images.
    pub observations: Vec<String>,
    /// How the images that it observes are made; `None` for vectors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<PictureCard>,
    /// Names of the discrete choices or of the action vector's dimensions; may be empty.
    pub actions: Vec<String>,
    /// Name of the algorithm.
    pub algorithm: String,
    /// What it was trained on, and for how long.
    pub training: String,
    /// The levels that it has seen, those that its demonstrations show among them; `None` where nobody noted them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seen: Option<SeenLevels>,
    /// Version and revision of the code that wrote the file.
    pub code: String,
}
