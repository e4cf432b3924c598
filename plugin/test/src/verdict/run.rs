//! Tests of a range of levels on all cores.

use crate::{
    detectors::{TestedBy, TestedLevel},
    findings::FindingFiles,
    verdict::{
        Finding, LevelVerdict, TooShort,
        error::TestError,
        judge,
        maps::level_name,
        plan::TestPlan,
        played::{Played, PlayedEnd, Task},
        reports::keep_findings,
        test_world::{EpisodeObserver, play_tasks},
    },
};
use bevy::math::Vec2;
use bevy_playbot::{
    episode::{EpisodeEnd, EpisodeResult},
    fault::Fault,
};
use playbot_harness::{eval::EvalError, game::Game, worlds::check_start};
use playbot_learner::Workers;
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Mutex, MutexGuard, PoisonError},
    thread,
    thread::Builder,
};

/// Approximate number of portions in which levels are handed out: no thread waits long for the last one.
const PORTIONS: usize = 64;

/// Levels of the first portion, which gives results soon. Each portion has twice as many as the one before, up to the
/// largest size.
const FIRST: usize = 4;

/// Most episodes of a portion: limits the memory, and the loss if the test is stopped.
const MOST_EPISODES: usize = 128;

/// Most arenas of a World.
const MOST_ARENAS: usize = 16;

/// End of a test: complete or stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TestEnd {
    /// Every level was tested.
    Done,
    /// `stop` returned true.
    Stopped,
}

/// Observers of a test.
pub struct TestObserver<'a> {
    /// Called with the number of newly finished episodes, from several threads.
    pub progress: &'a (dyn Fn(u64) + Sync),
    /// Returns whether to stop; finished levels are kept.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// State that the threads share.
struct Shared<'a> {
    next: usize,
    /// Portions that some testers have played: by portion and tester.
    open: BTreeMap<usize, Vec<Option<Vec<Played>>>>,
    keep: &'a mut (dyn FnMut(LevelVerdict) -> Result<(), TestError> + Send),
    failure: Option<TestError>,
    is_stopped: bool,
}

/// Tests every level of the plan except those with an index in `finished`, and hands each verdict to `keep`, in no
/// particular order. Memory does not grow with the number of levels.
///
/// An episode depends on the plan's seed, its tester and its level only: not on the threads, the shard, or other
/// levels and testers. A game that keeps state from one episode to the next breaks that, and `playbot doctor` reports
/// it.
///
/// # Errors
///
/// The plan tests nothing, the game cannot be played, or `keep` failed.
pub fn run_tests(
    game: &dyn Game,
    plan: &TestPlan,
    finished: &BTreeSet<u64>,
    keep: &mut (dyn FnMut(LevelVerdict) -> Result<(), TestError> + Send),
    watch: &TestObserver,
) -> Result<TestEnd, TestError> {
    plan.check()?;
    // Otherwise it would be a finding of each level.
    if game.problem().is_none() {
        check_start(game, &plan.split.mode, plan.split.first, |_| {}).map_err(EvalError::from)?;
    }
    run_tests_keeping(game, plan, finished, keep, watch, None)
}

/// Runs tests as [`run_tests`] does, with a file for each finding. A game that does not start is a finding of each level:
/// [`check_start`] tells before.
///
/// # Errors
///
/// As for [`run_tests`], or a finding cannot be written.
pub fn run_tests_keeping(
    game: &dyn Game,
    plan: &TestPlan,
    finished: &BTreeSet<u64>,
    keep: &mut (dyn FnMut(LevelVerdict) -> Result<(), TestError> + Send),
    watch: &TestObserver,
    files: Option<&FindingFiles>,
) -> Result<TestEnd, TestError> {
    plan.check()?;
    if let Some(problem) = game.problem() {
        return Err(EvalError::from(Fault(problem)).into());
    }
    let places: Vec<u64> = plan.places().into_iter().filter(|place| !finished.contains(place)).collect();
    let most = (MOST_EPISODES / plan.episodes.max(1) as usize).max(1);
    let size = places.len().div_ceil(PORTIONS).clamp(1, most);
    let portions = portions(&places, size);
    let shared = Shared { next: 0, open: BTreeMap::new(), keep, failure: None, is_stopped: false };
    let shared = Mutex::new(shared);
    let threads = plan.threads.clamp(1, (portions.len() * plan.testers.len()).max(1));
    // Networks take no other threads.
    let workers = || Workers::new(plan.threads / threads);
    let run = || workers().bound(|| work(game, plan, &portions, &shared, watch, files));
    thread::scope(|scope| {
        for _ in 1..threads {
            // If the system starts fewer threads, the test takes longer.
            let _ = Builder::new().spawn_scoped(scope, run);
        }
        run();
    });
    let Shared { failure, is_stopped, .. } = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
    match failure {
        Some(error) => Err(error),
        None if is_stopped => Ok(TestEnd::Stopped),
        None => Ok(TestEnd::Done),
    }
}

/// Splits the indices into portions that grow up to this size. Findings on a level do not depend on its portion.
fn portions(places: &[u64], largest: usize) -> Vec<&[u64]> {
    let (mut portions, mut rest, mut size) = (Vec::new(), places, FIRST.min(largest));
    while !rest.is_empty() {
        let (portion, others) = rest.split_at(size.min(rest.len()));
        portions.push(portion);
        (rest, size) = (others, (2 * size).min(largest));
    }
    portions
}

fn lock<'a, 'b>(shared: &'a Mutex<Shared<'b>>) -> MutexGuard<'a, Shared<'b>> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs one thread: portion after portion, each by one tester after the other.
fn work(
    game: &dyn Game,
    plan: &TestPlan,
    portions: &[&[u64]],
    shared: &Mutex<Shared>,
    watch: &TestObserver,
    files: Option<&FindingFiles>,
) {
    let testers = plan.testers.len();
    loop {
        let job = {
            let mut shared = lock(shared);
            if shared.failure.is_some() || shared.is_stopped {
                return;
            }
            shared.next += 1;
            shared.next - 1
        };
        let (portion, tester) = (job / testers, job % testers);
        let Some(places) = portions.get(portion) else { return };
        let played = match play_portion(game, plan, tester, places, watch) {
            Ok(Some(played)) => played,
            Ok(None) => {
                lock(shared).is_stopped = true;
                return;
            }
            Err(error) => {
                lock(shared).failure.get_or_insert(error);
                return;
            }
        };
        let Some(complete) = add(shared, portion, tester, testers, played) else { continue };
        let mut verdicts = judge_portion(game, plan, places, &complete, watch.stop);
        if (watch.stop)() {
            lock(shared).is_stopped = true;
            return;
        }
        let written = files.map_or(Ok(()), |files| {
            verdicts.iter_mut().try_for_each(|verdict| keep_findings(game, plan, files, verdict))
        });
        let mut shared = lock(shared);
        if let Err(error) = written {
            shared.failure.get_or_insert(error);
            return;
        }
        for verdict in verdicts {
            if shared.failure.is_none()
                && let Err(error) = (shared.keep)(verdict)
            {
                shared.failure = Some(error);
            }
        }
    }
}

fn play_portion(
    game: &dyn Game,
    plan: &TestPlan,
    tester: usize,
    places: &[u64],
    watch: &TestObserver,
) -> Result<Option<Vec<Played>>, TestError> {
    let tester = &plan.testers[tester];
    let mode = plan.split.mode.as_str();
    let mut tasks = Vec::new();
    for place in places {
        let level = plan.split.first + place;
        let name = level_name(game, &plan.split, level);
        let seed = |episode| plan.episode_seed(&tester.record, &name, episode);
        tasks.extend((0..plan.episodes.max(1)).map(|episode| Task { level, seed: seed(episode) }));
    }
    let (detectors, name) = (&plan.detectors, tester.record.name.as_str());
    let arenas = MOST_ARENAS;
    let watch = EpisodeObserver { progress: watch.progress, stop: watch.stop, detectors, mode, tester: name, arenas };
    play_tasks(game, mode, tester, &tasks, &watch).map_err(|error| EvalError::from(error).into())
}

/// Adds a tester's episodes of a portion, and returns the episodes of all testers once the portion is complete.
fn add(
    shared: &Mutex<Shared>,
    portion: usize,
    tester: usize,
    testers: usize,
    played: Vec<Played>,
) -> Option<Vec<Vec<Played>>> {
    let mut shared = lock(shared);
    let open = shared.open.entry(portion).or_insert_with(|| vec![None; testers]);
    open[tester] = Some(played);
    if open.iter().any(Option::is_none) {
        return None;
    }
    shared.open.remove(&portion).map(|complete| complete.into_iter().flatten().collect())
}

/// Judges the levels of a portion. Incomplete if `stop` returned true.
fn judge_portion(
    game: &dyn Game,
    plan: &TestPlan,
    places: &[u64],
    complete: &[Vec<Played>],
    stop: &dyn Fn() -> bool,
) -> Vec<LevelVerdict> {
    let episodes = plan.episodes.max(1) as usize;
    let verdict = |(number, place): (usize, &u64)| {
        let own = number * episodes..(number + 1) * episodes;
        let played: Vec<&[Played]> = complete.iter().map(|episodes| &episodes[own.clone()]).collect();
        let name = level_name(game, &plan.split, plan.split.first + place);
        judge(game, plan, (*place, name), &played, stop)
    };
    places.iter().enumerate().take_while(|_| !stop()).map(verdict).collect()
}

// Tests of one level on this thread.

/// Results of a level.
pub struct TestedInTurn {
    /// Verdict of the tester.
    pub verdict: LevelVerdict,
    /// Result of each episode; `None` if the game broke.
    pub ends: Vec<Option<EpisodeResult>>,
}

/// Lets the first tester of the plan play its first level under this name, which determines the seeds of the
/// episodes.
///
/// State that a game keeps from one episode to the next shows here. `progress` is called for each episode in order,
/// on this thread. `None` if `stop` returned true.
///
/// # Errors
///
/// The plan tests nothing, or the game cannot be played.
pub fn test_in_turn(
    game: &dyn Game,
    plan: &TestPlan,
    name: &str,
    watch: &TestObserver,
) -> Result<Option<TestedInTurn>, TestError> {
    plan.check()?;
    if let Some(problem) = game.problem() {
        return Err(EvalError::from(Fault(problem)).into());
    }
    let tester = plan.testers.first().ok_or(TestError::NoTester)?;
    let (mode, level) = (plan.split.mode.as_str(), plan.split.first);
    let task = |episode| Task { level, seed: plan.episode_seed(&tester.record, name, episode) };
    let tasks: Vec<Task> = (0..plan.episodes.max(1)).map(task).collect();
    let (detectors, tester_name) = (&plan.detectors, tester.record.name.as_str());
    let TestObserver { progress, stop } = *watch;
    let watch = EpisodeObserver { progress, stop, detectors, mode, tester: tester_name, arenas: 1 };
    let played = play_tasks(game, mode, tester, &tasks, &watch).map_err(EvalError::from)?;
    let Some(played) = played else { return Ok(None) };
    let ends = played.iter().map(ended).collect();
    let verdict = judge(game, plan, (0, name.to_owned()), &[played.as_slice()], stop);
    Ok((!stop()).then_some(TestedInTurn { verdict, ends }))
}

fn ended(episode: &Played) -> Option<EpisodeResult> {
    match &episode.end {
        PlayedEnd::Ended { result, .. } => Some(*result),
        PlayedEnd::Broken { .. } => None,
    }
}

// Findings from the defects that detectors report.

/// Returns the defects seen while testers played. A repeated defect in several episodes of a tester is reported once,
/// for the first.
pub(super) fn seen(plan: &TestPlan, played: &[&[Played]]) -> Vec<Finding> {
    let mut findings: Vec<Finding> = Vec::new();
    for (tester, episodes) in plan.testers.iter().zip(played) {
        for (number, episode) in (0..).zip(episodes.iter()) {
            for found in &episode.found {
                let name = Some(tester.record.name.clone());
                let is_known = |known: &Finding| known.tester == name && known.detector == found.detector;
                if !findings.iter().any(is_known) {
                    findings.push(Finding {
                        detector: found.detector.to_owned(),
                        tester: name,
                        episode: Some(number),
                        tick: Some(found.tick),
                        message: found.message.clone(),
                        file: None,
                        settings: Vec::new(),
                    });
                }
            }
        }
    }
    findings
}

/// Returns the findings of detectors that look at a level after its test, and the detectors for which its episodes were
/// too short. Incomplete if `stop` returned true.
pub(super) fn inspect(
    game: &dyn Game,
    plan: &TestPlan,
    (index, name): (u64, &str),
    played: &[&[Played]],
    stop: &dyn Fn() -> bool,
) -> (Vec<Finding>, Vec<TooShort>) {
    let level = plan.split.first + index;
    let testers = plan.testers.iter().zip(played).map(|(tester, episodes)| TestedBy {
        name: &tester.record.name,
        player: &tester.player,
        observation_config: tester.observation_config,
        seed: plan.episode_seed(&tester.record, name, 0),
        episodes: (0..).zip(episodes.iter()).filter_map(ended_by_defect).collect(),
        positions: (0..).zip(episodes.iter()).filter_map(ended_at).collect(),
    });
    let (mode, par) = (plan.split.mode.as_str(), plan.detectors.par(name));
    let tested = TestedLevel { game, mode, level, index, par, testers: testers.collect(), stop };
    let mut findings = Vec::new();
    for detector in plan.detectors.levels.iter().take_while(|_| !stop()) {
        findings.extend(detector.inspect(&tested).into_iter().map(|defect| Finding {
            detector: detector.name().to_owned(),
            tester: defect.tester,
            episode: defect.episode,
            tick: defect.tick,
            message: defect.message,
            file: None,
            settings: defect.settings,
        }));
    }
    (findings, too_short(plan, &tested, played))
}

/// Returns the detectors that could find nothing on a level, because its episodes were too short.
fn too_short(plan: &TestPlan, tested: &TestedLevel<'_>, played: &[&[Played]]) -> Vec<TooShort> {
    let short = |detector: &str, needs: u32, had: u32, setting: Option<String>| TooShort {
        detector: detector.to_owned(),
        needs,
        had,
        setting: setting.map(|setting| format!("{detector}.{setting}")),
    };
    let mut found = Vec::new();
    let episodes = || played.iter().flat_map(|episodes| episodes.iter());
    let is_cut = |episode: &Played| ended(episode).is_some_and(|end| end.end == EpisodeEnd::Truncated && !end.success);
    // Those that ended by themselves show no more to anybody who waits.
    if episodes().any(is_cut) {
        let had = episodes().map(|episode| episode.end.ticks()).max().unwrap_or(0);
        let has_positions =
            episodes().any(|episode| episode.track.route.as_ref().is_some_and(|it| it.entity.is_none()));
        let has_proofs = tested.game.tools().state.proves_states();
        for detector in &plan.detectors.ticks {
            let least = detector.least_episode();
            let is_known = (has_positions || !least.needs_position) && (has_proofs || !least.needs_proofs);
            if had < least.ticks && is_known {
                found.push(short(detector.name(), least.ticks, had, detector.setting_for(had)));
            }
        }
    }
    for detector in &plan.detectors.levels {
        let (needs, had) = (detector.least_ticks(), detector.most_ticks(tested));
        if let Some(had) = had.filter(|had| *had < needs) {
            found.push(short(detector.name(), needs, had, detector.setting_for(had)));
        }
    }
    found
}

fn ended_by_defect((number, episode): (u32, &Played)) -> Option<(u32, EpisodeResult)> {
    match &episode.end {
        PlayedEnd::Ended { result, .. } => Some((number, *result)),
        PlayedEnd::Broken { .. } => None,
    }
}

fn ended_at((number, episode): (u32, &Played)) -> Option<(u32, Vec2)> {
    match &episode.end {
        PlayedEnd::Ended { position, .. } => position.map(|position| (number, position)),
        PlayedEnd::Broken { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn portions_grow_and_leave_nothing_out() {
        let places: Vec<u64> = (0..100).collect();
        let sizes = |largest| portions(&places, largest).iter().map(|portion| portion.len()).collect::<Vec<_>>();
        assert_eq!(sizes(32), [4, 8, 16, 32, 32, 8]);
        assert_eq!(sizes(1), [1; 100]);
        assert_eq!(portions(&places, 32).concat(), places);
        assert!(portions(&[], 32).is_empty());
    }
}
