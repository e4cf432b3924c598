//! Testers that play.

use crate::score::{JobFinding, JobResult, end_of, error::ScoreError, found::Trial, mean_reward};
use bevy_playbot::{action::ActionValue, bot::BlindBot, state_hash::StateHash};
use playbot_harness::{
    detector::LevelProof,
    eval::{EvalError, Player},
    game::{idle_action, prove_level},
    split::LevelSplit,
};
use playbot_test::{
    detectors::{Detectors, ErrorLogReader, TestedBy, TestedLevel},
    explore::{
        Exploration, ExploreError, ExplorePlan, ExploredCell, Explorer, ReachedCell, Route, Stop, explore_until,
    },
    findings::{Breakage, Checks, FindingHead, Lengths, actions_of, minimise::lengths, scan},
    verdict::{Finding, LevelVerdict, TestError, TestObserver, TestPlan, Tester, TesterRecord, test_in_turn},
};
use std::{
    ops::ControlFlow,
    sync::{Mutex, PoisonError},
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
    let watch = TestObserver { progress: &progress, stop: trial.stop };
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

// Testers that explore.

/// Arenas of an exploration, side by side in one World.
const ARENAS: u32 = 8;

/// Findings of an exploration, with their times.
struct Sightings {
    findings: Vec<JobFinding>,
    first: Option<f64>,
    /// Indices of the findings that can be replayed, with the actions that lead to them.
    playable: Vec<(usize, Vec<ActionValue>)>,
}

impl Sightings {
    fn add(&mut self, finding: JobFinding, seconds: f64) {
        self.first.get_or_insert(seconds);
        if self.findings.iter().all(|known| known.detector != finding.detector) {
            self.findings.push(finding);
        }
    }
}

/// Explores a subject, and replays some of the paths that were found under the detectors; `None` if `stop` returned
/// true.
///
/// # Errors
///
/// The explorer cannot explore the game at all.
pub(super) fn search(trial: &Trial, explorer: &Explorer) -> Result<Option<JobResult>, ScoreError> {
    let mut sightings = Sightings { findings: Vec::new(), first: None, playable: Vec::new() };
    let ear = ErrorLogReader::new();
    let plan = exploration_plan(trial, explorer);
    let go_on = |_| ControlFlow::Continue(());
    let explored = ear.listen(|| explore_until(trial.game, &plan, |_| {}, go_on, trial.stop));
    hear_errors(trial, &ear, &mut sightings);
    let found = match explored {
        Ok(found) if found.stop == Stop::Asked => return Ok(None),
        Ok(found) => found,
        Err(error) => {
            let seconds = trial.clock.seconds();
            sightings.add(finding_of(error)?, seconds);
            return Ok(Some(result(sightings, None, None, None, seconds)));
        }
    };
    for route in routes(&found, trial.budget.routes as usize) {
        if (trial.stop)() {
            return Ok(None);
        }
        look_again(trial, &route, &mut sightings);
    }
    let solution = found.solution();
    inspect(trial, solution.as_ref(), &mut sightings);
    if (trial.stop)() {
        return Ok(None);
    }
    let ticks = found.solution_ticks();
    let proof = if ticks.is_some() { LevelProof::Solvable } else { prove_level(trial.game, trial.mode, trial.level) };
    let unsolvable = proof.why_unsolvable().map(str::to_owned);
    let seconds = trial.clock.seconds();
    let shortened = shortened_exploration(trial, &sightings);
    Ok(Some(result(sightings, ticks, unsolvable, shortened, seconds)))
}

fn exploration_plan(trial: &Trial, explorer: &Explorer) -> ExplorePlan {
    let words = trial.name.bytes().chain(trial.contestant.record.name.bytes()).map(u64::from);
    ExplorePlan {
        steps: trial.budget.steps.max(1),
        explorer: explorer.clone(),
        observation_config: trial.contestant.observation_config,
        seed: StateHash::of([trial.budget.seed].into_iter().chain(words)).0,
        arenas: ARENAS,
        worlds: 1,
        threads: 1,
        keeps_panics: false,
        snapshots: false,
        ..ExplorePlan::new(trial.mode, trial.level)
    }
}

/// Turns an error that ended an exploration into a finding.
fn finding_of(error: ExploreError) -> Result<JobFinding, ScoreError> {
    match error {
        ExploreError::Diverged { divergence, .. } => Ok(JobFinding {
            detector: "determinism".to_owned(),
            tick: Some(divergence.tick),
            message: format!("the path back to a cell does not replay: {divergence}"),
        }),
        ExploreError::Fault(fault) => {
            let Breakage { detector, message, .. } = Breakage::of_fault(&fault, 0);
            Ok(JobFinding { detector: detector.to_owned(), tick: None, message })
        }
        other => Err(other.into()),
    }
}

/// Adds the errors that were logged during the exploration, if a detector reads them.
fn hear_errors(trial: &Trial, ear: &ErrorLogReader, sightings: &mut Sightings) {
    let mut ticks = trial.detectors.ticks.iter();
    let listening = ticks.find(|it| it.watch_world().is_some_and(|watch| watch.hears_errors()));
    let error = ear.take().into_iter().next();
    if let (Some(detector), Some(message)) = (listening, error) {
        let message = format!("the game logged an error: {message}");
        let finding = JobFinding { detector: detector.name().to_owned(), tick: None, message };
        sightings.add(finding, trial.clock.seconds());
    }
}

/// Returns the path to the goal and the longest paths, at most `most`. Paths on which the episode ended and those on
/// which it goes on alternate.
fn routes(found: &Exploration, most: usize) -> Vec<Route> {
    let mut cells: Vec<(&ExploredCell, &ReachedCell)> = found.cells().iter().collect();
    cells.sort_by(|(one, near), (other, far)| far.ticks().cmp(&near.ticks()).then_with(|| one.cmp(other)));
    let (ended, open): (Vec<_>, Vec<_>) = cells.into_iter().partition(|(_, reached)| reached.is_over);
    let longest = ended.len().max(open.len());
    let in_turn = (0..longest).flat_map(|index| [ended.get(index), open.get(index)]).flatten();
    let ways = in_turn.filter_map(|(cell, _)| found.route_to(cell));
    let mut routes: Vec<Route> = Vec::new();
    for route in found.solution().into_iter().chain(ways) {
        if routes.len() >= most {
            break;
        }
        if !(route.is_empty() || routes.contains(&route)) {
            routes.push(route);
        }
    }
    routes
}

/// Ticks for which an agent stays at the end of a path.
const STAY: usize = 150;

fn actions(route: &Route) -> Vec<ActionValue> {
    (0..route.len()).map_while(|tick| route.actions.get(tick)).collect()
}

/// Replays a path under the detectors that look tick by tick.
fn look_again(trial: &Trial, route: &Route, sightings: &mut Sightings) {
    let mut actions = actions(route);
    // Some defects show only after the agent has stayed for a while.
    actions.extend(std::iter::repeat_n(idle_action(trial.game), STAY));
    // The streams of explorers begin from 0.
    let scanned = scan(trial.game, trial.mode, trial.level, 0, &actions, trial.detectors);
    for seen in scanned.seen {
        let finding = JobFinding { detector: seen.detector.to_owned(), tick: Some(seen.tick), message: seen.message };
        let count = sightings.findings.len();
        sightings.add(finding, trial.clock.seconds());
        if sightings.findings.len() > count {
            sightings.playable.push((count, actions.clone()));
        }
    }
}

/// Runs the detectors of levels. The path to the goal counts as an episode.
fn inspect(trial: &Trial, solution: Option<&Route>, sightings: &mut Sightings) {
    let ended = solution
        .and_then(|route| scan(trial.game, trial.mode, trial.level, 0, &actions(route), &Detectors::default()).end);
    // The detector of differences replays a random player, since explorers act at random.
    let anybody = Player::Blind(BlindBot::Uniform);
    let tester = TestedBy {
        name: &trial.contestant.record.name,
        player: &anybody,
        observation_config: trial.contestant.observation_config,
        seed: trial.budget.seed,
        episodes: ended.map(|end| (0, end)).into_iter().collect(),
        // The last positions are not examined.
        positions: std::collections::BTreeMap::new(),
    };
    let (game, mode, level) = (trial.game, trial.mode, trial.level);
    let tested = TestedLevel { game, mode, level, index: 0, par: None, testers: vec![tester], stop: trial.stop };
    for detector in &trial.detectors.levels {
        for defect in detector.inspect(&tested) {
            let detector = detector.name().to_owned();
            sightings.add(JobFinding { detector, tick: defect.tick, message: defect.message }, trial.clock.seconds());
        }
    }
}

/// Returns the first finding that can be replayed, minimised.
fn shortened_exploration(trial: &Trial, sightings: &Sightings) -> Option<Lengths> {
    let budget = trial.shortening()?;
    let checks = Checks::default().with_detectors(trial.detectors);
    sightings.playable.iter().find_map(|(index, actions)| {
        let finding = sightings.findings.get(*index)?;
        let head = FindingHead::new(trial.name, &finding.detector, &finding.message);
        lengths(trial.game, (trial.mode, trial.level), head, actions, &checks, budget, trial.stop)
    })
}

fn result(
    sightings: Sightings,
    solution: Option<u32>,
    unsolvable: Option<String>,
    shortened: Option<Lengths>,
    seconds: f64,
) -> JobResult {
    let proved_after = unsolvable.as_ref().map(|_| seconds);
    JobResult {
        solved: u64::from(solution.is_some()),
        episodes: 1,
        ends: vec![solution.map_or_else(|| "not found".to_owned(), |ticks| format!("won {ticks}"))],
        findings: sightings.findings,
        unsolvable,
        seconds,
        found_after: sightings.first.into_iter().chain(proved_after).min_by(f64::total_cmp),
        failed_after: solution.is_none().then_some(seconds),
        ..JobResult::default()
    }
    .with_lengths(shortened)
}
