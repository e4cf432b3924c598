//! Selection of the levels that the page shows.

use std::{cmp::Ordering, path::Path};

use crate::verdict::{LevelVerdict, ResultLines, TestError};

/// Largest number of levels in the table: a longer page would open slowly. All levels are in `results.json`.
const MOST_LEVELS: usize = 2_000;

/// Levels of a test, the worst ones first.
pub struct Selection {
    /// The levels of the table.
    pub levels: Vec<LevelVerdict>,
    /// Number of the other levels, which are not worse.
    pub left_out: u64,
}

impl Selection {
    /// Reads the results in a folder. Memory does not grow with their number.
    pub fn read(folder: &Path) -> Result<Self, TestError> {
        let mut lines = ResultLines::open(folder)?;
        let (mut levels, mut all) = (Vec::new(), 0_u64);
        while let Some(level) = lines.next_level()? {
            all += 1;
            levels.push(level);
            if levels.len() >= 2 * MOST_LEVELS {
                keep_worst(&mut levels);
            }
        }
        keep_worst(&mut levels);
        let left_out = all - levels.len() as u64;
        Ok(Self { levels, left_out })
    }
}

fn keep_worst(levels: &mut Vec<LevelVerdict>) {
    levels.sort_by(worst_first);
    levels.truncate(MOST_LEVELS);
}

/// Orders by more findings, then fewer solved episodes, then slower ones, then the order in the range.
fn worst_first(one: &LevelVerdict, other: &LevelVerdict) -> Ordering {
    let share = |a: &LevelVerdict, b: &LevelVerdict| u128::from(a.score.solved) * u128::from(b.score.episodes);
    let ticks = |level: &LevelVerdict| level.score.ticks.map_or(0.0, |ticks| ticks.median);
    let findings = other.findings.len().cmp(&one.findings.len());
    findings
        .then_with(|| one.outcome.cmp(&other.outcome))
        .then_with(|| share(one, other).cmp(&share(other, one)))
        .then_with(|| ticks(other).total_cmp(&ticks(one)))
        .then_with(|| one.index.cmp(&other.index))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict_report::testing::{finding, level, record, tested};

    #[test]
    fn findings_come_first_then_unsolved_levels_then_slow_ones() {
        let found = LevelVerdict { findings: vec![finding("panic", "index out of bounds")], ..level(4, 2, 2, 10) };
        let levels =
            [level(0, 2, 2, 30), level(1, 2, 2, 90), level(2, 0, 2, 0), level(3, 1, 2, 10), found, level(5, 2, 2, 30)];
        let parent = tempfile::tempdir().expect("a folder");
        let folder = tested(parent.path(), "whole", &record("hard:0..5", None), &levels);
        let selection = Selection::read(&folder).expect("results");
        let order: Vec<u64> = selection.levels.iter().map(|level| level.index).collect();
        assert_eq!((order, selection.left_out), (vec![4, 2, 3, 1, 0, 5], 0));
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
