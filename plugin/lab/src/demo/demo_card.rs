//! Which levels demonstrations show, as a skill model notes it and as it is checked.

use std::collections::{BTreeMap, BTreeSet};

use playbot_learner::{DemoCard, SkillModel};

use super::dataset::Demonstrations;
use crate::{game::Game, held_out::HeldOut, split::LevelSplit};

impl Demonstrations {
    /// What a skill model that is learned from them notes of them.
    pub(super) fn card(&self, game: &dyn Game) -> DemoCard {
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
        DemoCard {
            game: game.name().to_owned(),
            levels: ranges.map(|range| range.to_string()).collect(),
            level_files: files.into_iter().collect(),
        }
    }
}

/// Levels of a split that the demonstrations of a skill model show, in words; `None` if they show none, or if the model does not
/// note what it was learned from. The mode of the split has been checked with [`Game::check_mode`].
pub fn shown_by_demos(model: &SkillModel, game: &dyn Game, split: &LevelSplit) -> Option<String> {
    let card = model.demos().filter(|card| card.game == game.name())?;
    let held_out = HeldOut::new(game, split);
    // A mode that the game has no more has none of its levels.
    let ranges = card.levels.iter().filter_map(|range| range.parse::<LevelSplit>().ok());
    let mut known = ranges.filter(|range| game.check_mode(&range.mode).is_ok());
    let shown = known.find(|range| held_out.first_of(range).is_some()).map(|range| range.to_string());
    shown.or_else(|| {
        let mut files = card.level_files.iter().filter(|hash| held_out.contains_hash(**hash));
        files.next().map(|hash| format!("the level file of hash {hash:016x}"))
    })
}
