//! Sets of planted defects, in memory and as files.
//!
//! ```text
//! DIR/mutants.json     the defects with their levels, and the unmutated (sound) levels
//! DIR/levels/ID.json   the levels that a defect was planted into
//! ```

#[cfg(test)]
mod tests;

use crate::bugs::{BugError, defect_kinds};
use bevy_playbot::level::LevelFile;
use playbot_harness::{
    defect::Plant,
    game::Game,
    level_files::{LevelDesigns, level_files_mode},
    sealed_file::{io_error, write_atomically},
    split::LevelSplit,
};
use playbot_learner::{disk, write_atomically_with};
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeSet,
    fs, io,
    io::Write,
    path::{Path, PathBuf},
};

/// Name of the file.
const MUTANTS: &str = "mutants.json";

/// Folder of the levels.
const LEVELS: &str = "levels";

/// Planted defects, and unmutated levels to compare with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BugSet {
    /// Random seed that they were made from.
    pub seed: u64,
    /// The games, each once.
    pub games: Vec<BugGame>,
    /// The defects, by game and class.
    pub mutants: Vec<PlantedBug>,
    /// Unmutated levels.
    pub sound: Vec<UnmutatedLevels>,
}

/// A game with planted defects.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BugGame {
    /// Its name.
    pub name: String,
    /// Version of its rules.
    pub version: u32,
}

/// A game or a level with one planted defect.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "BugText", into = "BugText")]
pub struct PlantedBug {
    /// Its name in the set: game, class and number.
    pub id: String,
    /// Name of the game.
    pub game: String,
    /// Class of the defect.
    pub class: String,
    /// The defect, in one line.
    pub about: String,
    /// Mode of the unmutated level.
    pub mode: String,
    /// Number of the unmutated level.
    pub level: u64,
    /// The part that the defect is in.
    pub planted: PlantedPart,
}

/// The part that a defect is in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PlantedPart {
    /// A level: this file of the set's folder.
    Level(LevelFile),
    /// The rules, which are played on the unmutated level.
    Rules {
        /// Variant of the defect.
        variant: u32,
    },
}

/// Unmutated levels of a game.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnmutatedLevels {
    /// Name of the game.
    pub game: String,
    /// The levels.
    pub range: LevelSplit,
}

impl PlantedBug {
    /// Returns the unmutated level, as `MODE:N`.
    pub fn base(&self) -> String {
        format!("{}:{}", self.mode, self.level)
    }

    /// Returns mode and number of the level that testers play. `folder` is the set's.
    pub fn played(&self, folder: &Path) -> (String, u64) {
        match &self.planted {
            PlantedPart::Level(file) => (level_files_mode(&folder.join(&file.path).to_string_lossy()), 0),
            PlantedPart::Rules { .. } => (self.mode.clone(), self.level),
        }
    }
}

impl BugSet {
    /// Returns whether a folder has a set.
    pub fn is_in(folder: &Path) -> bool {
        folder.join(MUTANTS).exists()
    }

    /// Reads the set of a folder.
    ///
    /// # Errors
    ///
    /// [`BugError::Missing`], [`BugError::Damaged`], or the file cannot be read.
    pub fn read(folder: &Path) -> Result<Self, BugError> {
        let path = folder.join(MUTANTS);
        let text = fs::read_to_string(&path).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => BugError::Missing(folder.to_owned()),
            io::ErrorKind::InvalidData => damaged(&path, 1, "it is not UTF-8 text"),
            _ => io_error("read", &path)(error).into(),
        })?;
        let set: SetText = serde_json::from_str(&text).map_err(|error| damaged(&path, error.line(), error))?;
        if set.format != FORMAT {
            let what = format!("it is of format {}, and this program reads format {FORMAT}", set.format);
            return Err(damaged(&path, 1, what));
        }
        let SetText { seed, games, mutants, sound, .. } = set;
        let set = Self { seed, games, mutants, sound };
        let contradiction = set.contradiction().map(|(name, what)| (name.to_owned(), what));
        match contradiction {
            // The first line that names it.
            Some((name, what)) => {
                let line = text.lines().position(|line| line.contains(&format!("\"{name}\""))).map_or(1, |at| at + 1);
                Err(damaged(&path, line, what))
            }
            None => Ok(set),
        }
    }

    /// Returns an inconsistency, with the name that it is about.
    fn contradiction(&self) -> Option<(&str, String)> {
        let mut ids = BTreeSet::new();
        let games: BTreeSet<&str> = self.games.iter().map(|game| game.name.as_str()).collect();
        if games.len() != self.games.len() {
            return Some(("games", "a game is named twice".to_owned()));
        }
        for bug in &self.mutants {
            if !ids.insert(&bug.id) {
                return Some((bug.id.as_str(), format!("two mutants are called `{}`", bug.id)));
            }
            if !games.contains(bug.game.as_str()) {
                return Some((
                    bug.id.as_str(),
                    format!("the game `{}` of `{}` is missing in `games`", bug.game, bug.id),
                ));
            }
        }
        let strange = self.sound.iter().find(|sound| !games.contains(sound.game.as_str()))?;
        Some((strange.game.as_str(), format!("the game `{}` of sound levels is missing in `games`", strange.game)))
    }

    /// Writes the set, with the texts of its levels by the names of their mutants. Older levels are removed, and the
    /// file that names them is written last.
    ///
    /// # Errors
    ///
    /// [`BugError::Exists`] unless `replace`; or the system cannot write.
    pub fn write(&self, folder: &Path, levels: &[(String, String)], replace: bool) -> Result<(), BugError> {
        if !replace && Self::is_in(folder) {
            return Err(BugError::Exists(folder.to_owned()));
        }
        let (path, level_folder) = (folder.join(MUTANTS), folder.join(LEVELS));
        gone(disk::remove_file(&path)).map_err(io_error("remove", &path))?;
        if replace {
            gone(disk::remove_dir_all(&level_folder)).map_err(io_error("remove", &level_folder))?;
        }
        disk::create_dir_all(&level_folder).map_err(io_error("create", &level_folder))?;
        for (id, text) in levels {
            let file = folder.join(level_path(id));
            write_atomically(&file, format!("{}\n", text.trim_end()).as_bytes())?;
        }
        let Self { seed, games, mutants, sound } = self.clone();
        let text = SetText { format: FORMAT, seed, games, mutants, sound };
        let written = write_atomically_with(&path, |file| {
            serde_json::to_writer_pretty(&mut *file, &text)?;
            writeln!(file)
        });
        Ok(written.map_err(io_error("write", &path))?)
    }

    /// Checks that the mutants of a game can be planted. The game must have the version of the set and these kinds of
    /// defects, and the levels must be unchanged. Sets for other games pass.
    ///
    /// # Errors
    ///
    /// [`BugError::Version`], [`BugError::Damaged`], or a level cannot be read.
    pub fn check(&self, folder: &Path, game: &dyn Game) -> Result<(), BugError> {
        let path = folder.join(MUTANTS);
        let Some(known) = self.games.iter().find(|known| known.name == game.name()) else { return Ok(()) };
        if known.version != game.version() {
            let (made, is) = (known.version, game.version());
            return Err(BugError::Version { path, game: known.name.clone(), made, is });
        }
        let kinds = defect_kinds(game);
        for bug in self.mutants.iter().filter(|bug| bug.game == known.name) {
            let fits = match &bug.planted {
                // A broken level is a file, so its kind need not be known.
                PlantedPart::Level(_) => true,
                PlantedPart::Rules { variant } => kinds.iter().any(|kind| match &kind.plant {
                    Plant::Rules { variants, .. } => kind.class == bug.class && variant < variants,
                    Plant::Level(_) => false,
                }),
            };
            if !fits {
                let (game, class, id) = (&known.name, &bug.class, &bug.id);
                let what = format!("this program's `{game}` has no defect `{class}`, which `{id}` needs");
                return Err(damaged(&path, 1, what));
            }
            if let PlantedPart::Level(file) = &bug.planted {
                let level = folder.join(&file.path);
                let designs = LevelDesigns::of_file(&level.to_string_lossy(), &|text| game.parse_level(text))?;
                if designs.hash(0) != Some(file.hash) {
                    let what = format!("the level of `{}` was changed after it was planted", bug.id);
                    return Err(damaged(&level, 1, what));
                }
            }
        }
        Ok(())
    }
}

fn damaged(path: &Path, line: usize, what: impl ToString) -> BugError {
    let what = what.to_string();
    // serde repeats the line at the end of its message.
    let words = what.find(" at line ").map_or(what.as_str(), |at| &what[..at]).to_owned();
    BugError::Damaged { path: PathBuf::from(path), line: line.max(1), what: words }
}

/// Treats a missing file as removed.
fn gone(removed: io::Result<()>) -> io::Result<()> {
    match removed {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

// The file format of planted defects.

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
    pub(super) sound: Vec<UnmutatedLevels>,
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
