//! Findings on level files that are replayed from another folder than that of the test.

use std::path::{Path, PathBuf};

use super::stored::StoredFinding;
use crate::{
    game::{Game, read_level_designs},
    level_files::{is_level_files, level_files_mode},
};

impl StoredFinding {
    /// Returns the finding of this file with the right path of its level file. Level files are named relative to the
    /// folder of the test. A level file that is not in the current folder is searched for in each folder above the
    /// finding. It is accepted if it has the recorded level. Otherwise nothing changes.
    #[must_use]
    pub fn seen_from(mut self, game: &dyn Game, file: &Path) -> Self {
        if let Some(mode) = self.mode_above(game, file) {
            self.header.mode = mode;
            self.episode.level_seed = 0;
        }
        self
    }

    /// Replaces mode, number and file of the level by those of another finding, so that the level has the name from the
    /// test.
    #[must_use]
    pub fn with_level_of(mut self, other: &Self) -> Self {
        self.header.mode.clone_from(&other.header.mode);
        self.episode.level_seed = other.episode.level_seed;
        self.episode.level_file.clone_from(&other.episode.level_file);
        self
    }

    /// Returns the mode of the level file in a folder above this file.
    fn mode_above(&self, game: &dyn Game, file: &Path) -> Option<String> {
        let recorded = self.episode.level_file.as_ref().filter(|_| is_level_files(&self.header.mode))?;
        let path = Path::new(&recorded.path);
        if path.is_absolute() || path.exists() {
            return None;
        }
        let file = std::path::absolute(file).ok()?;
        let candidates = file.ancestors().skip(1).map(|folder| folder.join(path));
        candidates.filter(|candidate| candidate.is_file()).find_map(|candidate: PathBuf| {
            let mode = level_files_mode(candidate.to_str()?);
            let designs = read_level_designs(game, &mode).ok()?;
            // A file of that name may contain another level.
            (designs.hash(0) == Some(recorded.hash)).then_some(mode)
        })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use bevy_playbot::{demo::file::DemoEpisode, level_files::LevelFile};

    use super::*;
    use crate::{
        corridor::{Corridor, to_the_goal},
        findings::{Checks, FindingHead, recheck},
        level_files::LevelDesign,
    };

    /// A path without a file, relative to the folder of this test.
    const LEVEL: &str = "lv-of-another-folder/a.json";

    #[test]
    fn a_level_is_found_above_its_finding_if_it_is_the_same_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let level = folder.path().join(LEVEL);
        fs::create_dir_all(level.parent().expect("a folder")).expect("writable");
        // Behind the wall.
        fs::write(&level, "9").expect("writable");
        let game = Corridor::default();
        let mode = level_files_mode(level.to_str().expect("text"));
        let head = FindingHead::new(LEVEL, "unreachable-goal", "walled in");
        let checks = Checks::default();
        let there = StoredFinding::of_actions(&game, &mode, 0, head, &to_the_goal(), &checks).expect("it is there");
        let hash = LevelDesign::new((), "9").hash();
        let mut stored = there.clone();
        stored.header.mode = level_files_mode(LEVEL);
        stored.episode.level_file = Some(LevelFile { path: LEVEL.to_owned(), hash });
        let file = folder.path().join("runs/test/findings/a.finding");
        let words = recheck(&game, &stored, &checks).expect_err("seen from elsewhere").to_string();
        assert!(words.contains("from the folder where the test was run") && !words.contains("remove"), "{words}");
        let seen = stored.clone().seen_from(&game, &file);
        assert_eq!(seen.header.mode, mode);
        assert!(recheck(&game, &seen, &checks).expect("it is found").is_same(&stored));
        assert_eq!(seen.with_level_of(&stored), stored, "what is written names no folder of a machine");
        assert_eq!(there.clone().seen_from(&game, &file), there, "what is found needs no search");
        // Another level under the name.
        fs::write(&level, "2").expect("writable");
        assert_eq!(stored.clone().seen_from(&game, &file), stored);
        fs::write(&level, "no level").expect("writable");
        assert_eq!(stored.clone().seen_from(&game, &file), stored);
    }

    #[test]
    fn levels_that_are_no_files_stay() {
        let stored = crate::findings::testing::stored();
        let file = Path::new("runs/a.finding");
        assert_eq!(stored.clone().seen_from(&Corridor::default(), file), stored);
        let mut drawn = stored;
        drawn.header.mode = level_files_mode(LEVEL);
        drawn.episode = DemoEpisode::new(0, drawn.header.actions);
        assert_eq!(drawn.clone().seen_from(&Corridor::default(), file), drawn, "it names no level file");
    }
}
