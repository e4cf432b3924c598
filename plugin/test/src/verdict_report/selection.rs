//! The levels of the page, the worst ones first.

use crate::verdict::{LevelOutcome, LevelVerdict, ResultLines, TestError};
use std::{cmp::Ordering, path::Path};

/// Largest number of levels in the table: a longer page would open slowly. All levels are in `results.json`.
const MOST_LEVELS: usize = 2_000;

/// Largest number of levels in the gallery.
const MOST_THUMBS: usize = 10_000;

/// Levels of a test, the worst ones first.
pub struct Selection {
    /// The levels of the table.
    pub levels: Vec<LevelVerdict>,
    /// Number of the other levels, which are not worse.
    pub left_out: u64,
    /// The levels of the gallery.
    pub gallery: Vec<SmallLevel>,
    /// Number of all levels.
    pub all: u64,
}

impl Selection {
    /// Reads the results in a folder, and calls `each` for each level. Memory does not grow with their number.
    pub fn read(folder: &Path, each: &mut dyn FnMut(&LevelVerdict)) -> Result<Self, TestError> {
        let mut lines = ResultLines::open(folder)?;
        let (mut levels, mut gallery, mut all) = (Vec::new(), Vec::new(), 0_u64);
        while let Some(level) = lines.next_level()? {
            all += 1;
            each(&level);
            gallery.push((Standing::of(&level), SmallLevel::of(&level, problems(&level))));
            if gallery.len() >= 2 * MOST_THUMBS {
                keep_worst_small(&mut gallery);
            }
            levels.push(level);
            if levels.len() >= 2 * MOST_LEVELS {
                keep_worst(&mut levels);
            }
        }
        keep_worst(&mut levels);
        keep_worst_small(&mut gallery);
        let left_out = all - levels.len() as u64;
        Ok(Self { levels, left_out, gallery: gallery.into_iter().map(|(_, level)| level).collect(), all })
    }
}

fn keep_worst(levels: &mut Vec<LevelVerdict>) {
    levels.sort_by(|one, other| Standing::of(one).worst_first(&Standing::of(other)));
    levels.truncate(MOST_LEVELS);
}

fn keep_worst_small(levels: &mut Vec<(Standing, SmallLevel)>) {
    levels.sort_by(|(one, _), (other, _)| one.worst_first(other));
    levels.truncate(MOST_THUMBS);
}

/// What the order of levels depends on.
struct Standing {
    problems: usize,
    outcome: LevelOutcome,
    solved: u64,
    episodes: u64,
    ticks: f64,
    index: u64,
}

impl Standing {
    fn of(level: &LevelVerdict) -> Self {
        let LevelVerdict { score, outcome, index, .. } = level;
        let ticks = score.ticks.map_or(0.0, |ticks| ticks.median);
        let (solved, episodes) = (score.solved, score.episodes);
        Self { problems: problems(level), outcome: *outcome, solved, episodes, ticks, index: *index }
    }

    /// Orders by the outcome, from proved unsolvable to solved, then by more findings, fewer solved episodes, slower ones,
    /// and the order in the range. So no two levels are equal, and shards joined in any order give the same page.
    fn worst_first(&self, other: &Self) -> Ordering {
        let share = |a: &Self, b: &Self| u128::from(a.solved) * u128::from(b.episodes);
        let outcomes = self.outcome.cmp(&other.outcome);
        outcomes
            .then_with(|| other.problems.cmp(&self.problems))
            .then_with(|| share(self, other).cmp(&share(other, self)))
            .then_with(|| other.ticks.total_cmp(&self.ticks))
            .then_with(|| self.index.cmp(&other.index))
    }
}

/// Returns the number of findings, with one for a recording that no longer ends as it did.
pub(crate) fn problems(level: &LevelVerdict) -> usize {
    level.findings.len() + usize::from(level.is_regression())
}

/// What the gallery shows of a level.
#[derive(Clone, Debug, PartialEq)]
pub struct SmallLevel {
    /// Its index in the range.
    pub index: u64,
    /// Its name.
    pub title: String,
    /// The rank of its outcome.
    pub outcome: u8,
    /// Findings, with one for a recording that no longer ends as it did.
    pub findings: usize,
    /// A few words about it.
    pub words: String,
}

impl SmallLevel {
    /// Takes what is shown of a level with so many findings.
    pub fn of(level: &LevelVerdict, findings: usize) -> Self {
        let (solved, episodes) = (level.score.solved, level.score.episodes);
        let share = || format!("{solved} of {episodes}");
        let words = match (level.findings.first(), level.score.ticks) {
            (Some(finding), _) => finding.detector.clone(),
            (None, _) if findings > 0 => "recording".to_owned(),
            (None, Some(ticks)) if solved == episodes => format!("{} ticks", playbot_report::ticks(ticks.median)),
            (None, _) => share(),
        };
        Self { index: level.index, title: level.title(), outcome: level.outcome as u8, findings, words }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict_report::testing::{finding, level, record, tested};

    #[test]
    fn the_outcome_comes_first_then_findings_then_failures_then_slow_levels_then_the_number() {
        let found = LevelVerdict { findings: vec![finding("panic", "index out of bounds")], ..level(4, 2, 2, 10) };
        let proved = |index| LevelVerdict {
            outcome: LevelOutcome::ProvedUnsolvable,
            findings: vec![finding("unreachable-goal", "a wall")],
            ..level(index, 0, 2, 0)
        };
        let twice = LevelVerdict { findings: [0; 2].map(|_| finding("stuck", "")).to_vec(), ..level(8, 0, 2, 0) };
        let levels = [
            level(0, 2, 2, 30),
            level(1, 2, 2, 90),
            level(2, 0, 2, 0),
            level(3, 1, 2, 10),
            found,
            level(5, 2, 2, 30),
            proved(6),
            proved(7),
            twice,
            level(9, 0, 2, 0),
        ];
        let parent = tempfile::tempdir().expect("a folder");
        let folder = tested(parent.path(), "whole", &record("hard:0..9", None), &levels);
        let selection = Selection::read(&folder, &mut |_| {}).expect("results");
        let order: Vec<u64> = selection.levels.iter().map(|level| level.index).collect();
        assert_eq!((order, selection.left_out), (vec![6, 7, 8, 2, 9, 4, 3, 1, 0, 5], 0));
    }

    #[test]
    fn of_many_levels_the_worst_are_kept() {
        let (mut levels, most) = (Vec::new(), MOST_LEVELS as u64);
        for index in 0..4 * most + 7 {
            // Every 100th is not solved.
            levels.push(level(index, u64::from(index % 100 != 99), 1, 20));
            if levels.len() >= 2 * MOST_LEVELS {
                keep_worst(&mut levels);
            }
        }
        keep_worst(&mut levels);
        let order: Vec<u64> = levels.iter().map(|level| level.index).collect();
        let failed = (0..80).map(|number| 100 * number + 99);
        let solved = (0..).filter(|index| index % 100 != 99);
        assert_eq!(order, failed.chain(solved).take(MOST_LEVELS).collect::<Vec<u64>>());
    }
}
