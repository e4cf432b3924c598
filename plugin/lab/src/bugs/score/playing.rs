//! Testers that play.

use std::sync::{Mutex, PoisonError};

use super::{
    error::ScoreError,
    job::{JobFinding, JobResult, end_of, mean_reward},
    trial::Trial,
};
use crate::{
    eval::{EvalError, Player},
    findings::{Breakage, Checks, FindingHead, Lengths, actions_of, lengths},
    split::LevelSplit,
    verdict::{Finding, LevelVerdict, TestError, TestPlan, TestWatch, Tester, TesterRecord, test_in_turn},
};

/// Findings of a job that are tried until one can be replayed.
const MOST_TRIED: usize = 3;

/// Plays a subject's episodes, one after the other in the same World; `None` if `stop` returned true.
///
/// # Errors
///
/// The tester cannot play the game at all.
pub(super) fn play(trial: &Trial, player: &Player) -> Result<Option<JobResult>, ScoreError> {
    let plan = plan(trial, player);
    let times = Mutex::new(Vec::new());
    let progress = |_: u64| times.lock().unwrap_or_else(PoisonError::into_inner).push(trial.clock.seconds());
    let watch = TestWatch { progress: &progress, stop: trial.stop };
    let tested = match test_in_turn(trial.game, &plan, trial.name, &watch) {
        Ok(Some(tested)) => tested,
        Ok(None) => return Ok(None),
        // The game panicked while its World was built.
        Err(TestError::Eval(EvalError::Fault(fault))) => {
            return Ok(Some(JobResult::broken(Breakage::of_fault(&fault, 0), trial.clock.seconds())));
        }
        Err(TestError::Eval(EvalError::Vision(error))) => return Err(error.into()),
        Err(error) => return Err(error.into()),
    };
    let seconds = trial.clock.seconds();
    let times = times.into_inner().unwrap_or_else(PoisonError::into_inner);
    let verdict = &tested.verdict;
    let unsolvable = verdict.proof.why_unsolvable().map(str::to_owned);
    let found: Vec<&Finding> = verdict.findings.iter().filter(|finding| !is_proof(verdict, finding)).collect();
    let after = |finding: &&Finding| {
        let is_of_level = trial.detectors.levels.iter().any(|detector| detector.name() == finding.detector);
        let episode = finding.episode.filter(|_| !is_of_level);
        episode.and_then(|episode| times.get(episode as usize)).copied().unwrap_or(seconds)
    };
    let proved_after = unsolvable.as_ref().map(|_| seconds);
    let found_after = found.iter().map(after).chain(proved_after).min_by(f64::total_cmp);
    let failed = tested.ends.iter().position(|end| end.is_none_or(|end| !end.success));
    let shortened = shortened(trial, player, &plan, &found);
    let finding = |finding: &&Finding| JobFinding {
        detector: finding.detector.clone(),
        tick: finding.tick,
        message: finding.message.clone(),
    };
    Ok(Some(
        JobResult {
            solved: verdict.score.solved,
            episodes: verdict.score.episodes,
            exact: verdict.testers.iter().all(|tester| tester.exact),
            ends: tested.ends.iter().map(|end| end_of(end.as_ref())).collect(),
            reward: mean_reward(&tested.ends),
            findings: found.iter().map(finding).collect(),
            unsolvable,
            seconds,
            found_after,
            failed_after: failed.map(|episode| times.get(episode).copied().unwrap_or(seconds)),
            ..JobResult::default()
        }
        .with_lengths(shortened),
    ))
}

fn plan(trial: &Trial, player: &Player) -> TestPlan {
    let contestant = trial.contestant;
    let tester = Tester {
        record: TesterRecord::bot(&contestant.record.name),
        player: player.clone(),
        observation_config: contestant.observation_config,
    };
    TestPlan {
        split: LevelSplit { mode: trial.mode.to_owned(), first: trial.level, last: trial.level },
        testers: vec![tester],
        episodes: trial.budget.episodes.max(1),
        seed: trial.budget.seed,
        detectors: trial.detectors.clone(),
        shard: None,
        threads: 1,
    }
}

/// Returns whether this finding is the proof that the level is unsolvable.
fn is_proof(verdict: &LevelVerdict, finding: &Finding) -> bool {
    finding.tester.is_none() && verdict.proof.why_unsolvable() == Some(finding.message.as_str())
}

/// Returns the first finding that can be replayed, minimised.
fn shortened(trial: &Trial, player: &Player, plan: &TestPlan, found: &[&Finding]) -> Option<Lengths> {
    let budget = trial.shortening()?;
    let tester = plan.testers.first()?;
    let checks = Checks::default().with_detectors(trial.detectors);
    let place = (trial.mode, trial.level);
    let played = found.iter().filter_map(|finding| Some((finding, finding.episode?)));
    played.take(MOST_TRIED).find_map(|(finding, episode)| {
        let seed = plan.episode_seed(&tester.record, trial.name, episode);
        let actions = actions_of(trial.game, place, seed, player, &tester.observation_config)?;
        let head = FindingHead { seed, ..FindingHead::new(trial.name, &finding.detector, &finding.message) };
        lengths(trial.game, place, head, &actions, &checks, budget, trial.stop)
    })
}
