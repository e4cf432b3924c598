//! The run of all testers on all subjects, on all cores.

use std::{
    sync::{Mutex, MutexGuard, PoisonError},
    thread::{self, Builder},
};

use bevy_playbot::panics::hear;

use super::{
    case::{Case, cases},
    clock::JobClock,
    contestant::{Contestant, Means},
    error::ScoreError,
    exploring::search,
    file::Score,
    found::judge,
    job::JobResult,
    journal::ScoreJournal,
    plan::ScorePlan,
    playing::play,
    trial::Trial,
};
use crate::findings::Breakage;

/// The callbacks of a running score.
pub struct ScoreWatch<'a> {
    /// Receives how many more jobs have finished; called from several threads.
    pub progress: &'a (dyn Fn(u64) + Sync),
    /// Returns true to stop; finished jobs are kept.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// A score in progress.
pub struct ScoreRun<'a> {
    plan: &'a ScorePlan<'a>,
    cases: Vec<Case>,
}

/// The state that the threads share.
struct Shared<'a> {
    next: usize,
    journal: &'a mut ScoreJournal,
    failure: Option<ScoreError>,
    is_stopped: bool,
}

impl<'a> ScoreRun<'a> {
    /// Checks the plan, and reads all levels.
    ///
    /// # Errors
    ///
    /// The plan tests nothing, or something in the set cannot be played.
    pub fn new(plan: &'a ScorePlan<'a>) -> Result<Self, ScoreError> {
        plan.check()?;
        Ok(Self { plan, cases: cases(plan)? })
    }

    /// Returns the number of jobs: each tester on each subject of its game.
    pub fn jobs(&self) -> u64 {
        self.cases.iter().map(|case| self.plan.games[case.game].contestants.len() as u64).sum()
    }

    /// Runs all jobs that the journal does not have, and judges all of them; `None` if `stop` returned true.
    ///
    /// Each job runs on one thread. Its results, apart from the times, depend on the plan's budget, the tester and the
    /// subject alone. A mutant that makes a tester panic is a finding.
    ///
    /// # Errors
    ///
    /// A tester cannot play at all, or the journal cannot be written.
    pub fn run(&self, journal: &mut ScoreJournal, watch: &ScoreWatch) -> Result<Option<Score>, ScoreError> {
        let is_open = |(case, contestant): &(&Case, &Contestant)| {
            let key = (case.subject.id.clone(), contestant.record.name.clone());
            !journal.finished().contains_key(&key)
        };
        let open: Vec<(&Case, &Contestant)> = self.all().filter(is_open).collect();
        let threads = self.plan.threads.clamp(1, open.len().max(1));
        let shared = Mutex::new(Shared { next: 0, journal: &mut *journal, failure: None, is_stopped: false });
        thread::scope(|scope| {
            for _ in 1..threads {
                // With fewer threads than asked for, the score only takes longer.
                let _ = Builder::new().spawn_scoped(scope, || self.work(&open, &shared, watch));
            }
            self.work(&open, &shared, watch);
        });
        let Shared { failure, is_stopped, .. } = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
        match failure {
            Some(error) => return Err(error),
            None if is_stopped => return Ok(None),
            None => {}
        }
        let result = |(case, contestant): (&Case, &Contestant)| {
            journal.finished().get(&(case.subject.id.clone(), contestant.record.name.clone())).cloned()
        };
        let results: Vec<JobResult> = self.all().filter_map(result).collect();
        let subjects: Vec<_> = self.cases.iter().map(|case| case.subject.clone()).collect();
        let jobs = judge(&subjects, results);
        Ok(Some(Score { record: self.plan.record(), command: journal.command().to_owned(), subjects, jobs }))
    }

    /// Returns all jobs in the order of the score.
    fn all(&self) -> impl Iterator<Item = (&Case, &Contestant)> {
        self.cases.iter().flat_map(move |case| {
            self.plan.games[case.game].contestants.iter().map(move |contestant| (case, contestant))
        })
    }

    /// Runs job after job on one thread.
    fn work(&self, open: &[(&Case, &Contestant)], shared: &Mutex<Shared>, watch: &ScoreWatch) {
        loop {
            let (case, contestant) = {
                let mut shared = lock(shared);
                if shared.failure.is_some() || shared.is_stopped {
                    return;
                }
                shared.next += 1;
                match open.get(shared.next - 1) {
                    Some(job) => *job,
                    None => return,
                }
            };
            let done = self.job(case, contestant, watch);
            let mut shared = lock(shared);
            match done {
                Ok(Some(result)) => match shared.journal.push(result) {
                    Ok(()) => (watch.progress)(1),
                    Err(error) => {
                        shared.failure.get_or_insert(error);
                    }
                },
                Ok(None) => shared.is_stopped = true,
                Err(error) => {
                    shared.failure.get_or_insert(error);
                }
            }
        }
    }

    fn job(&self, case: &Case, contestant: &Contestant, watch: &ScoreWatch) -> Result<Option<JobResult>, ScoreError> {
        if (watch.stop)() {
            return Ok(None);
        }
        let tested = &self.plan.games[case.game];
        let mutant = case.mutant(tested.game);
        let clock = JobClock::start(self.plan.clock);
        let trial = Trial {
            game: &mutant,
            mode: &case.mode,
            level: case.level,
            name: &case.name,
            contestant,
            detectors: &tested.detectors,
            budget: self.plan.budget,
            shortens: case.subject.class().is_some(),
            clock,
            stop: watch.stop,
        };
        let done = hear(|| match &contestant.means {
            Means::Plays(player) => play(&trial, player),
            Means::Explores(explorer) => search(&trial, explorer),
        });
        let result = done.unwrap_or_else(|message| {
            let broken = Breakage { detector: "panic", tick: 0, message };
            Ok(Some(JobResult::broken(broken, trial.clock.seconds())))
        })?;
        let (subject, tester) = (case.subject.id.clone(), contestant.record.name.clone());
        Ok(result.map(|result| JobResult { subject, tester, ..result }))
    }
}

fn lock<'a, 'b>(shared: &'a Mutex<Shared<'b>>) -> MutexGuard<'a, Shared<'b>> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
