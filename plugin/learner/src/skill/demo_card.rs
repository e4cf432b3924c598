//! What demonstrations say about themselves to people.

use serde::{Deserialize, Serialize};

/// Where the demonstrations come from that skills are learned from, for people and for checks: a policy that plays these skills has
/// seen their levels.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub struct DemoCard {
    /// Name of the game.
    pub game: String,
    /// The levels that they show, as ranges with both ends, such as `hard:0..63`.
    pub levels: Vec<String>,
    /// Hashes of the level files that they show.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub level_files: Vec<u64>,
}
