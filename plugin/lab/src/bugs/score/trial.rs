//! The trial of one tester on one subject.

use super::{clock::JobClock, contestant::Contestant, record::ScoreBudget};
use crate::{detectors::Detectors, findings::Budget, game::Game};

/// The inputs of a job.
pub(super) struct Trial<'a> {
    /// The game, with a defect in its rules if there is one.
    pub game: &'a dyn Game,
    /// Mode of the level.
    pub mode: &'a str,
    /// Number of the level.
    pub level: u64,
    /// Name of the unmutated level, from which all seeds are derived, so that a mutant is tested as its original is.
    pub name: &'a str,
    /// The tester.
    pub contestant: &'a Contestant,
    /// The detectors.
    pub detectors: &'a Detectors,
    /// The budget.
    pub budget: ScoreBudget,
    /// Whether findings are minimised.
    pub shortens: bool,
    /// Runs from the start of the job.
    pub clock: JobClock,
    /// Returns true to stop.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// Most ticks of all replays that minimise a finding, for each replay that is allowed.
const TICKS_PER_REPLAY: u64 = 2000;

impl Trial<'_> {
    /// Returns the budget of minimisation; `None` for no minimisation.
    pub fn shortening(&self) -> Option<Budget> {
        let replays = self.budget.replays;
        let is_wanted = self.shortens && replays > 0;
        is_wanted.then(|| Budget { replays, ticks: u64::from(replays) * TICKS_PER_REPLAY })
    }
}
