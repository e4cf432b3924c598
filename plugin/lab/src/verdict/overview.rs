//! Totals of results, and the worst levels.

use std::path::Path;

use super::{
    error::TestError,
    fisher::Trials,
    level_verdict::{LevelOutcome, LevelVerdict},
    places::Places,
    plan::TestRecord,
    results::ResultLines,
};

/// Largest number of worst levels that are reported.
pub const MOST_WORST: usize = 20;

/// Totals of a tester over all levels.
#[derive(Clone, Debug, PartialEq)]
pub struct TesterTotal {
    /// Its name.
    pub name: String,
    /// Levels that it solved at least once, among all.
    pub levels: Trials,
    /// Episodes that it solved, among all.
    pub episodes: Trials,
    /// Open squares that it visited, over all levels with maps.
    pub places: Places,
}

/// Totals of all results, and the worst levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Overview {
    /// Description of the test.
    pub record: TestRecord,
    /// Number of levels.
    pub levels: u64,
    /// Levels that were solved.
    pub solved: u64,
    /// Levels without a success and without a proof.
    pub bot_failed: u64,
    /// Levels whose goal cannot be reached.
    pub proved_unsolvable: u64,
    /// Findings of all levels.
    pub findings: u64,
    /// Open squares that any tester visited, over all levels with maps.
    pub places: Places,
    /// The testers, in the order of the test.
    pub testers: Vec<TesterTotal>,
    /// At most 20 levels that were not solved each time, or that have a finding, the worst ones first.
    pub worst: Vec<LevelVerdict>,
}

impl Overview {
    /// Reads the results in a folder.
    ///
    /// # Errors
    ///
    /// The folder has no results, or they are damaged.
    pub fn read(folder: &Path) -> Result<Self, TestError> {
        let mut lines = ResultLines::open(folder)?;
        let mut overview = Self::empty(lines.record().clone());
        while let Some(level) = lines.next_level()? {
            overview.add(level);
        }
        Ok(overview)
    }

    fn empty(record: TestRecord) -> Self {
        let places = Places::default();
        let total = |name: &String| TesterTotal {
            name: name.clone(),
            levels: Trials::default(),
            episodes: Trials::default(),
            places,
        };
        let testers = record.testers.iter().map(|tester| total(&tester.name)).collect();
        let worst = Vec::new();
        Self { record, levels: 0, solved: 0, bot_failed: 0, proved_unsolvable: 0, findings: 0, places, testers, worst }
    }

    fn add(&mut self, level: LevelVerdict) {
        self.levels += 1;
        self.findings += level.findings.len() as u64;
        self.places.add(level.places);
        *match level.outcome {
            LevelOutcome::Solved => &mut self.solved,
            LevelOutcome::BotFailed => &mut self.bot_failed,
            LevelOutcome::ProvedUnsolvable => &mut self.proved_unsolvable,
        } += 1;
        for (total, tester) in self.testers.iter_mut().zip(&level.testers) {
            total.levels.trials += 1;
            total.levels.successes += u64::from(tester.score.solved > 0);
            let Trials { successes, trials } = &mut total.episodes;
            *trials = trials.saturating_add(tester.score.episodes);
            *successes = successes.saturating_add(tester.score.solved);
            total.places.add(tester.places);
        }
        if !level.is_perfect() {
            let place = self.worst.partition_point(|other| is_worse(other, &level));
            if place < MOST_WORST {
                self.worst.insert(place, level);
                self.worst.truncate(MOST_WORST);
            }
        }
    }

    /// Returns whether every level was solved and has no finding.
    pub fn is_sound(&self) -> bool {
        self.findings == 0 && self.solved == self.levels
    }
}

/// Returns whether a level is at least as bad as a later one of the range.
fn is_worse(level: &LevelVerdict, later: &LevelVerdict) -> bool {
    let rank = |level: &LevelVerdict| (level.outcome, level.findings.is_empty());
    let (one, other) = (level.score.trials(), later.score.trials());
    let shares = (u128::from(one.successes) * u128::from(other.trials))
        .cmp(&(u128::from(other.successes) * u128::from(one.trials)));
    rank(level).cmp(&rank(later)).then(shares).is_le()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        proof::LevelProof,
        verdict::{Finding, MapScope, TesterRecord, testing::verdict},
    };

    #[test]
    fn the_worst_come_first_and_perfect_ones_not_at_all() {
        let record = TestRecord {
            game: "garden".to_owned(),
            game_version: 1,
            range: "hard:0..99".parse().expect("a split"),
            files: None,
            seed: 0,
            testers: vec![TesterRecord::bot("random")],
            episodes: 4,
            detectors: Vec::new(),
            options: Vec::new(),
            maps: MapScope::default(),
            shard: None,
        };
        let mut overview = Overview::empty(record);
        for (index, solved) in [4, 3, 0, 1, 0].into_iter().enumerate() {
            let mut level =
                LevelVerdict { places: Some(Places { visited: 3, open: 4 }), ..verdict(index as u64, solved, 4) };
            level.testers[0].places = Some(Places { visited: 1, open: 4 });
            overview.add(level);
        }
        let why = "walled in".to_owned();
        let finding = Finding {
            detector: "unreachable-goal".to_owned(),
            tester: None,
            episode: None,
            tick: None,
            message: why.clone(),
            file: None,
            settings: Vec::new(),
        };
        let proved = LevelVerdict {
            outcome: LevelOutcome::ProvedUnsolvable,
            proof: LevelProof::Unsolvable { why },
            findings: vec![finding],
            ..verdict(5, 0, 4)
        };
        overview.add(proved);
        let worst: Vec<u64> = overview.worst.iter().map(|level| level.index).collect();
        assert_eq!(worst, [5, 2, 4, 3, 1]);
        assert_eq!((overview.solved, overview.bot_failed, overview.proved_unsolvable), (3, 2, 1));
        assert_eq!(overview.testers[0].levels, Trials { successes: 3, trials: 6 });
        assert_eq!(overview.testers[0].episodes, Trials { successes: 8, trials: 24 });
        assert_eq!(overview.places, Places { visited: 15, open: 20 }, "the sixth level has no maps");
        assert_eq!(overview.testers[0].places.percent(), Some(25.0));
        assert!(!overview.is_sound());
        for index in 6..60 {
            overview.add(verdict(index, 0, 4));
        }
        assert_eq!((overview.worst.len(), overview.worst[0].index), (20, 5));
    }
}
