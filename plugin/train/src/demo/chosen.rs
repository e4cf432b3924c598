//! The selection of recorded episodes to learn from.

use crate::demo::Demonstrations;
use playbot_harness::{
    demo::VerifyError,
    game::{Game, level_designs},
    split::LevelSplit,
};
use playbot_learner::{SeenLevels, Streams, rng::shuffle};
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

impl Demonstrations {
    /// Keeps the episodes that ended at the goal.
    ///
    /// # Errors
    ///
    /// [`VerifyError::NoneWon`] if there are none.
    pub fn won(mut self, path: &Path) -> Result<Self, VerifyError> {
        let episodes = self.episodes.len();
        self.episodes.retain(|demo| demo.episode.is_success());
        if self.episodes.is_empty() {
            return Err(VerifyError::NoneWon { path: path.to_owned(), episodes });
        }
        Ok(self)
    }

    /// Keeps whole episodes of at most `steps` steps together, but at least one episode. They are drawn evenly over the
    /// recordings. The choice is reproducible, and more steps only add episodes.
    pub fn at_most(mut self, steps: u64) -> Self {
        // At random, since recordings repeat the same levels in the same order: every n-th episode might always be on
        // the same level.
        let mut order: Vec<usize> = (0..self.episodes.len()).collect();
        shuffle(&mut order, &mut Streams::new(0).stream("demonstrations", 0));
        let mut sum = 0;
        let kept = order.iter().take_while(|index| {
            sum += self.episodes[**index].episode.len() as u64;
            sum <= steps
        });
        let kept = kept.count().max(1);
        let mut keep = vec![false; self.episodes.len()];
        order.iter().take(kept).for_each(|&index| keep[index] = true);
        let mut keep = keep.into_iter();
        self.episodes.retain(|_| keep.next().unwrap_or(false));
        self
    }

    /// Returns the levels that the demonstrations show. Recordings keep the hashes of files and not their layouts, so the
    /// layouts are those of the files that are still there.
    pub fn seen_levels(&self, game: &dyn Game) -> SeenLevels {
        let (mut levels, mut files) = (BTreeMap::<&str, BTreeSet<u64>>::new(), BTreeSet::new());
        let mut modes_of_files = BTreeSet::<&str>::new();
        for demo in &self.episodes {
            match &demo.episode.level_file {
                Some(file) => {
                    files.insert(file.hash);
                    modes_of_files.insert(&demo.mode);
                }
                None => {
                    levels.entry(&demo.mode).or_default().insert(demo.episode.level_seed);
                }
            }
        }
        let mut layouts = BTreeSet::new();
        for designs in modes_of_files.iter().filter_map(|mode| level_designs(game, mode).ok()) {
            let is_recorded = |level: &u64| designs.hash(*level).is_some_and(|hash| files.contains(&hash));
            layouts.extend((0..designs.count()).filter(is_recorded).filter_map(|level| designs.layout(level)));
        }
        let ranges = levels
            .into_iter()
            .flat_map(|(mode, seeds)| LevelSplit::ranges(mode, &seeds.into_iter().collect::<Vec<_>>()));
        SeenLevels {
            game: game.name().to_owned(),
            levels: ranges.map(|range| range.to_string()).collect(),
            level_files: files.into_iter().collect(),
            layouts: layouts.into_iter().collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demo::tests::all;
    use bevy_playbot::demo::file::{DemoActions, DemoEnd, DemoEpisode};

    #[test]
    fn lost_episodes_are_left_out_where_only_won_ones_are_wanted() {
        let ended = |ends: &[DemoEnd]| {
            all(ends.iter().map(|&end| DemoEpisode { end, ..DemoEpisode::new(0, DemoActions::Discrete(2)) }))
        };
        let (won, lost) = (DemoEnd::Terminated { success: true }, DemoEnd::Terminated { success: false });
        let path = Path::new("a.demo");
        let kept = ended(&[lost, won, DemoEnd::Truncated, won, DemoEnd::Aborted]).won(path).expect("two are won");
        assert_eq!(kept.episodes.iter().map(|demo| demo.index).collect::<Vec<_>>(), [1, 3]);
        let error = ended(&[lost, DemoEnd::Truncated]).won(path).expect_err("none is won").to_string();
        assert!(error.contains("a.demo: none of the 2 recorded episodes"), "{error}");
    }

    #[test]
    fn what_is_kept_is_drawn_from_all_episodes_and_levels() {
        let all = || {
            all((0..80).map(|index| DemoEpisode {
                state_hashes: vec![0; 10],
                ..DemoEpisode::new(index % 8, DemoActions::Discrete(2))
            }))
        };
        let kept = |steps| all().at_most(steps).episodes.iter().map(|demo| demo.index).collect::<Vec<_>>();
        let part = kept(209);
        assert_eq!(part.len(), 20);
        let early = part.iter().filter(|index| **index < 40).count();
        assert!((3..=17).contains(&early), "{part:?}");
        let levels: std::collections::BTreeSet<usize> = part.iter().map(|index| index % 8).collect();
        assert!(levels.len() >= 5, "levels follow one another in a rhythm of 8, of which {levels:?} are kept");
        assert!(kept(150).iter().all(|index| part.contains(index)), "fewer steps are a part of more");
        assert_eq!((kept(1).len(), kept(800).len(), kept(u64::MAX).len()), (1, 80, 80));
    }
}
