//! The levels of demonstrations, as learners store them.

use std::collections::{BTreeMap, BTreeSet};

use playbot_learner::SeenLevels;

use super::dataset::Demonstrations;
use crate::{game::Game, split::LevelSplit};

impl Demonstrations {
    /// Returns the levels that the demonstrations show.
    pub fn seen_levels(&self, game: &dyn Game) -> SeenLevels {
        let (mut levels, mut files) = (BTreeMap::<&str, BTreeSet<u64>>::new(), BTreeSet::new());
        for demo in &self.episodes {
            match &demo.episode.level_file {
                Some(file) => files.insert(file.hash),
                None => levels.entry(&demo.mode).or_default().insert(demo.episode.level_seed),
            };
        }
        let ranges = levels
            .into_iter()
            .flat_map(|(mode, seeds)| LevelSplit::ranges(mode, &seeds.into_iter().collect::<Vec<_>>()));
        SeenLevels {
            game: game.name().to_owned(),
            levels: ranges.map(|range| range.to_string()).collect(),
            level_files: files.into_iter().collect(),
        }
    }
}
