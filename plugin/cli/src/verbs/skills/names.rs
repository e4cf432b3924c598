//! Names of regions of skills, in a file beside the policy.

use crate::{
    arguments::player::{PlayerArgs, SKILL_NAMES},
    error::CliError,
    output,
};
use bevy_playbot::skill_prior::NamedSkill;
use playbot_harness::sealed_file::io_error;
use std::{fs, io, path::Path};

/// The named regions of a policy's skills.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SkillNames {
    pub regions: Vec<NamedSkill>,
}

impl SkillNames {
    /// Reads a file; none is like an empty one.
    ///
    /// # Errors
    ///
    /// It cannot be read, or holds something else.
    pub fn read(path: &Path) -> Result<Self, CliError> {
        let text = match fs::read_to_string(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            text => text.map_err(io_error("read", path))?,
        };
        let regions = serde_json::from_str(&text).map_err(|error| {
            let path = path.display();
            CliError::Usage(format!(
                "{path}: not a list of named skills ({error}): mend or remove it, or name another file with `playbot skills \
                 --names`"
            ))
        })?;
        Ok(Self { regions })
    }

    /// Reads the names of the skills of a policy's file, from the file beside it.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read).
    pub fn beside_policy(policy: &Path) -> Result<Self, CliError> {
        Self::read(&policy.with_extension(SKILL_NAMES))
    }

    /// Reads the names of the skills of a run, from the file in its folder.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read).
    pub fn of_run(folder: &Path) -> Result<Self, CliError> {
        Self::read(&folder.join(SKILL_NAMES))
    }

    /// Reads the names of a player's skills; none for a bot.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read).
    pub fn of_player(player: &PlayerArgs) -> Result<Self, CliError> {
        player.names_file().map_or_else(|| Ok(Self::default()), |file| Self::read(&file))
    }

    /// Writes the file.
    ///
    /// # Errors
    ///
    /// The system refuses.
    pub fn write(&self, path: &Path) -> Result<(), CliError> {
        let text = serde_json::to_string_pretty(&self.regions).unwrap_or_default();
        output::write(path, format!("{text}\n").as_bytes())
    }

    /// Returns the names with a region more. It replaces those in which its middle lies; an empty name only takes them
    /// away.
    pub fn with(&self, region: NamedSkill) -> Self {
        let mut regions = self.regions.clone();
        regions.retain(|known| !known.holds(&region.z));
        if !region.name.trim().is_empty() {
            regions.push(region);
        }
        Self { regions }
    }

    /// Returns the name of a skill: that of the region in which it lies, the one with the nearest middle.
    pub fn of(&self, z: &[f32]) -> Option<&str> {
        NamedSkill::name_of(&self.regions, z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region(name: &str, z: [f32; 2]) -> NamedSkill {
        NamedSkill { name: name.to_owned(), z: z.to_vec(), radius: 0.5 }
    }

    #[test]
    fn names_are_kept_replaced_and_taken_away() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("names.json");
        assert_eq!(SkillNames::read(&path).expect("none yet"), SkillNames::default());
        let names = SkillNames::default().with(region("jump", [0.0, 0.9])).with(region("walk", [0.9, 0.0]));
        names.write(&path).expect("writable");
        let read = SkillNames::read(&path).expect("it is there");
        assert_eq!(read, names);
        names.write(&folder.path().join("bot.skill-names.json")).expect("writable");
        assert_eq!(SkillNames::beside_policy(&folder.path().join("bot.policy")).expect("it is there"), names);
        assert_eq!(SkillNames::of_run(folder.path()).expect("none yet"), SkillNames::default());
        names.write(&folder.path().join("skill-names.json")).expect("writable");
        assert_eq!(SkillNames::of_run(folder.path()).expect("it is there"), names);
        assert_eq!(read.of(&[0.1, 0.8]), Some("jump"));
        assert_eq!(read.of(&[-0.9, -0.9]), None);
        let renamed = read.with(region("leap", [0.0, 0.8]));
        assert_eq!((renamed.of(&[0.0, 0.9]), renamed.regions.len()), (Some("leap"), 2));
        assert_eq!(renamed.with(region(" ", [0.0, 0.8])).of(&[0.0, 0.9]), None);
        std::fs::write(&path, "{}").expect("writable");
        let error = SkillNames::read(&path).expect_err("no list").to_string();
        assert!(error.contains("not a list of named skills"), "{error}");
    }
}
