//! What is to be scored.

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

/// How testers are scored.
#[derive(Clone)]
pub struct ScorePlan<'a> {
    /// The mutants and sound levels.
    pub set: &'a BugSet,
    /// Folder of the set.
    pub folder: &'a Path,
    /// The games that are tested; others of the set are left out.
    pub games: Vec<TestedGame<'a>>,
    /// How much each tester may do on each of them.
    pub budget: ScoreBudget,
    /// What times are measured with.
    pub clock: ClockKind,
    /// Threads; no part of the result but for the times.
    pub threads: usize,
}

/// A game, and who tests it.
#[derive(Clone)]
pub struct TestedGame<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Who tests it, with different names.
    pub contestants: Vec<Contestant>,
    /// What looks for defects.
    pub detectors: Detectors,
}

impl ScorePlan<'_> {
    /// Checks that something is tested, and that testers can be told apart.
    ///
    /// # Errors
    ///
    /// [`ScoreError::NoMutant`], [`ScoreError::NoTester`], [`ScoreError::SameName`], or the set is none of this program.
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

    /// What files say of it.
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

/// A hash of all that is planted, and of the sound levels.
fn hash_of(set: &BugSet) -> String {
    let BugSet { seed, games, mutants, sound } = set;
    let text = serde_json::to_string(&(seed, games, mutants, sound)).unwrap_or_default();
    format!("{:016x}", StateHash::of(text.bytes().map(u64::from)).0)
}
