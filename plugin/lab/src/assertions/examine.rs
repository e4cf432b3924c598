//! The run of the testers over the levels of an assertion.

use std::{
    collections::BTreeSet,
    sync::{Mutex, PoisonError},
};

use super::{
    commands::Commands,
    error::LevelTestError,
    evidence::Evidence,
    failure::{Failure, MOST_SHOWN},
    level_test::LevelTest,
    testers::{Named, bot_names},
    wanted::Wanted,
};
use crate::{
    detectors::{DetectorChoice, Detectors},
    split::LevelSplit,
    verdict::{LevelVerdict, TestError, TestPlan, TestWatch, Tester, run_tests},
};

/// Only one test of a process plays at a time: each takes all cores, and two may write the same finding.
static PLAYING: Mutex<()> = Mutex::new(());

impl LevelTest<'_> {
    /// Returns the verdicts on all levels.
    pub(super) fn all(&self) -> Result<Vec<LevelVerdict>, LevelTestError> {
        let _alone = PLAYING.lock().unwrap_or_else(PoisonError::into_inner);
        let plan = self.plan(Wanted::Nothing)?;
        self.broken(&plan, Wanted::Nothing)
    }

    /// Checks whether the assertion holds, and returns the message of its failure if not.
    pub(super) fn check(&self, wanted: Wanted) -> Result<(), String> {
        match self.failure(wanted) {
            Ok(None) => Ok(()),
            Ok(Some(failure)) => Err(failure),
            Err(error) => Err(format!("cannot test {} of `{}`: {error}", self.levels, self.game.name())),
        }
    }

    /// Returns the message of a failure, if there is one.
    fn failure(&self, wanted: Wanted) -> Result<Option<String>, LevelTestError> {
        let _alone = PLAYING.lock().unwrap_or_else(PoisonError::into_inner);
        let plan = self.plan(wanted)?;
        let mut broken = self.broken(&plan, wanted)?;
        if broken.is_empty() {
            return Ok(None);
        }
        let evidence = Evidence::new(self.game, &plan, wanted, &self.folder, self.minimise);
        let kept: Result<Vec<_>, _> = broken.iter_mut().take(MOST_SHOWN).map(|level| evidence.keep(level)).collect();
        let commands = self.commands(&plan);
        let (episodes, folder) = (kept?, self.folder.as_path());
        Ok(Some(Failure { wanted, plan: &plan, broken: &broken, episodes: &episodes, folder, commands }.text()))
    }

    fn commands(&self, plan: &TestPlan) -> Commands<'_> {
        let mut record = plan.record(self.game);
        record.testers.retain(|tester| self.named.iter().all(|named| named.own_name() != Some(tester.name.as_str())));
        let policies = self.named.iter().zip(&plan.testers).filter_map(|(named, tester)| match named {
            Named::Policy { path, .. } => Some((tester.record.name.clone(), path.display().to_string())),
            Named::Bot(_) | Named::Player { .. } => None,
        });
        Commands { program: &self.program, record, policies: policies.collect() }
    }

    /// Returns the levels for which the assertion does not hold, in their order.
    fn broken(&self, plan: &TestPlan, wanted: Wanted) -> Result<Vec<LevelVerdict>, LevelTestError> {
        let mut broken = Vec::new();
        let mut keep = |level: LevelVerdict| -> Result<(), TestError> {
            if !wanted.holds(&level) {
                broken.push(level);
            }
            Ok(())
        };
        let watch = TestWatch { progress: &|_| {}, stop: &|| false };
        run_tests(self.game, plan, &BTreeSet::new(), &mut keep, &watch)?;
        broken.sort_by_key(|level| level.index);
        Ok(broken)
    }

    fn plan(&self, wanted: Wanted) -> Result<TestPlan, LevelTestError> {
        let split: LevelSplit = self.levels.parse()?;
        split.check(self.game)?;
        let plan = TestPlan {
            split,
            testers: self.testers(wanted)?,
            episodes: self.episodes,
            seed: self.seed,
            detectors: Detectors::choose(self.game, &self.choice(wanted))?,
            shard: None,
            threads: self.threads,
        };
        plan.check()?;
        Ok(plan)
    }

    fn testers(&self, wanted: Wanted) -> Result<Vec<Tester>, LevelTestError> {
        if !self.named.is_empty() {
            return self.named.iter().map(|named| named.tester(self.game)).collect();
        }
        let bots = bot_names(self.game);
        let count = if matches!(wanted, Wanted::NoFindings | Wanted::Deterministic) { bots.len() } else { 1 };
        if bots.is_empty() {
            return Err(LevelTestError::NoBot(self.game.name()));
        }
        bots.into_iter().take(count).map(|name| Named::Bot(name.to_owned()).tester(self.game)).collect()
    }

    /// Returns the selected detectors, or `determinism` alone for [`Wanted::Deterministic`].
    fn choice(&self, wanted: Wanted) -> DetectorChoice {
        let mut choice = self.detectors.clone();
        if wanted == Wanted::Deterministic {
            choice.with.push("determinism".to_owned());
            choice.without.push("all".to_owned());
            let usual = ["determinism.every=1", "determinism.ticks=100000"].map(str::to_owned);
            // Explicit settings come last, and win.
            choice.settings = usual.into_iter().chain(choice.settings).collect();
        }
        choice
    }
}
