//! The file format of planted defects.

use bevy_playbot::level_files::LevelFile;
use serde::{Deserialize, Serialize};

use super::set::{BugGame, PlantedBug, PlantedPart, SoundLevels};

/// Version of the file format.
pub(super) const FORMAT: u32 = 1;

/// `mutants.json`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SetText {
    pub(super) format: u32,
    pub(super) seed: u64,
    pub(super) games: Vec<BugGame>,
    pub(super) mutants: Vec<PlantedBug>,
    pub(super) sound: Vec<SoundLevels>,
}

/// A mutant.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BugText {
    id: String,
    game: String,
    class: String,
    about: String,
    base: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    level: Option<LevelText>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    variant: Option<u32>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LevelText {
    file: String,
    /// 16 hexadecimal digits, since some readers of JSON have no integers of 64 bits.
    hash: String,
}

impl TryFrom<BugText> for PlantedBug {
    type Error = String;

    fn try_from(text: BugText) -> Result<Self, String> {
        let BugText { id, game, class, about, base, level, variant } = text;
        let parsed = base.rsplit_once(':').and_then(|(mode, level)| Some((mode.to_owned(), level.parse().ok()?)));
        let Some((mode, level_number)) = parsed else {
            return Err(format!("the base `{base}` of `{id}` must be MODE:N"));
        };
        let planted = match (level, variant) {
            (Some(LevelText { file, hash }), None) => {
                if file != level_path(&id) || !is_plain(&id) {
                    return Err(format!("the level of `{id}` must be levels/ID.json, and is `{file}`"));
                }
                let hash = u64::from_str_radix(&hash, 16)
                    .map_err(|_| format!("the hash `{hash}` of `{id}` is not made of hexadecimal digits"))?;
                PlantedPart::Level(LevelFile { path: file, hash })
            }
            (None, Some(variant)) => PlantedPart::Rules { variant },
            _ => return Err(format!("`{id}` must have either `level` or `variant`")),
        };
        Ok(Self { id, game, class, about, mode, level: level_number, planted })
    }
}

impl From<PlantedBug> for BugText {
    fn from(bug: PlantedBug) -> Self {
        let base = bug.base();
        let PlantedBug { id, game, class, about, planted, .. } = bug;
        let (level, variant) = match planted {
            PlantedPart::Level(LevelFile { path, hash }) => {
                (Some(LevelText { file: path, hash: format!("{hash:016x}") }), None)
            }
            PlantedPart::Rules { variant } => (None, Some(variant)),
        };
        Self { id, game, class, about, base, level, variant }
    }
}

/// Returns the path of a mutant's level in the folder of the set.
pub(super) fn level_path(id: &str) -> String {
    format!("levels/{id}.json")
}

/// Returns whether a name is a plain file name that leaves no folder.
fn is_plain(id: &str) -> bool {
    !id.is_empty() && id.chars().all(|letter| letter.is_ascii_alphanumeric() || "-_".contains(letter))
}
