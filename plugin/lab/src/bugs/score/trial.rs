//! One tester, set on one subject.

use super::{clock::JobClock, contestant::Contestant, record::ScoreBudget};
use crate::{detectors::Detectors, findings::Budget, game::Game};

/// What a job works on.
pub(super) struct Trial<'a> {
    /// The game, with a defect in its rules if one is planted there.
    pub game: &'a dyn Game,
    /// Mode of the level.
    pub mode: &'a str,
    /// Number of the level.
    pub level: u64,
    /// Name from which all seeds come: that of the sound level, so that a mutant is tested as its original is.
    pub name: &'a str,
    /// Who tests.
    pub contestant: &'a Contestant,
    /// What looks for defects.
    pub detectors: &'a Detectors,
    /// How much may be done.
    pub budget: ScoreBudget,
    /// Whether findings are made shorter.
    pub shortens: bool,
    /// Runs since the beginning of the job.
    pub clock: JobClock,
    /// Whether to stop.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// Most ticks of all replays in which a finding is made shorter, for each replay that is allowed.
const TICKS_PER_REPLAY: u64 = 2000;

impl Trial<'_> {
    /// How much is tried to make a finding shorter; `None` for nothing.
    pub fn shortening(&self) -> Option<Budget> {
        let replays = self.budget.replays;
        let is_wanted = self.shortens && replays > 0;
        is_wanted.then(|| Budget { replays, ticks: u64::from(replays) * TICKS_PER_REPLAY })
    }
}
