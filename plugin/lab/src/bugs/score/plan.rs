//! The plan of a score.

use std::path::Path;

use bevy_playbot::state_hash::StateHash;

use super::{
    clock::ClockKind,
    contestant::Contestant,
    error::ScoreError,
    record::{GameRecord, SCORE_FORMAT, ScoreBudget, ScoreRecord, SetRecord},
};
use crate::{
    bugs::BugSet,
    detectors::{Detectors, own_detectors},
    game::Game,
};

/// The plan of a score: sets, games, testers, budget.
#[derive(Clone)]
pub struct ScorePlan<'a> {
    /// The mutants and unmutated levels.
    pub set: &'a BugSet,
    /// Folder of the set.
    pub folder: &'a Path,
    /// The games that are tested; others of the set are left out.
    pub games: Vec<TestedGame<'a>>,
    /// The budget of each tester on each of them.
    pub budget: ScoreBudget,
    /// The clock.
    pub clock: ClockKind,
    /// Threads. They change no result but the times.
    pub threads: usize,
}

/// A game, and its testers.
#[derive(Clone)]
pub struct TestedGame<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// The testers, with different names.
    pub contestants: Vec<Contestant>,
    /// The detectors.
    pub detectors: Detectors,
}

impl ScorePlan<'_> {
    /// Checks that there is something to test, and that testers have different names.
    ///
    /// # Errors
    ///
    /// [`ScoreError::NoMutant`], [`ScoreError::NoTester`], [`ScoreError::SameName`], or the set does not fit this
    /// program.
    pub fn check(&self) -> Result<(), ScoreError> {
        let is_tested = |name: &str| self.games.iter().any(|tested| tested.game.name() == name);
        if !self.set.mutants.iter().any(|bug| is_tested(&bug.game)) {
            let names: Vec<&str> = self.games.iter().map(|tested| tested.game.name()).collect();
            return Err(ScoreError::NoMutant(names.join(", ")));
        }
        for TestedGame { game, contestants, .. } in &self.games {
            self.set.check(self.folder, *game)?;
            if contestants.is_empty() {
                return Err(ScoreError::NoTester(game.name().to_owned()));
            }
            for (index, contestant) in contestants.iter().enumerate() {
                let name = &contestant.record.name;
                if contestants[..index].iter().any(|other| other.record.name == *name) {
                    return Err(ScoreError::SameName { game: game.name().to_owned(), tester: name.clone() });
                }
            }
        }
        Ok(())
    }

    /// Returns the record of the plan that files store.
    pub fn record(&self) -> ScoreRecord {
        let game = |tested: &TestedGame| GameRecord {
            name: tested.game.name().to_owned(),
            version: tested.game.version(),
            testers: tested.contestants.iter().map(|contestant| contestant.record.clone()).collect(),
            detectors: tested.detectors.record().to_vec(),
            own_detectors: own_detectors(tested.game),
        };
        ScoreRecord {
            format: SCORE_FORMAT,
            set: SetRecord { seed: self.set.seed, hash: hash_of(self.set) },
            games: self.games.iter().map(game).collect(),
            budget: self.budget,
            clock: self.clock,
        }
    }
}

/// Returns a hash of all mutants and unmutated levels.
fn hash_of(set: &BugSet) -> String {
    let BugSet { seed, games, mutants, sound } = set;
    let text = serde_json::to_string(&(seed, games, mutants, sound)).unwrap_or_default();
    format!("{:016x}", StateHash::of(text.bytes().map(u64::from)).0)
}
