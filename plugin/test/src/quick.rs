//! The verdict on a level while it is drawn: as soon as possible, with the path that solves it.
//!
//! [`judge_quickly`] asks the quickest first: the actions that solved the level before, then testers, as a
//! [test](crate::verdict) does, and an explorer if none of them solves it. What is known so far is handed to the caller
//! after each of them.
//!
//! - `picture`: the picture of the level, with the path or with the places that were not reached.

mod picture;

use crate::{
    detectors::Detectors,
    explore::{Exploration, ExploreError, ExplorePlan, Until, explore_until},
    findings::{CheckTick, PlayedSetting, Replayed, Watcher, play_actions, play_player},
    quick::picture::picture,
    verdict::{
        Finding, LevelOutcome, LevelVerdict, Places, TestError, TestObserver, TestPlan, Tester, maps::level_name,
        run_tests_keeping,
    },
    verdict_report::Reached,
};
use bevy::math::Vec2;
use bevy_playbot::{action::ActionValue, episode::EpisodeEnd};
use playbot_harness::{floor_plan::FloorPlan, game::Game, split::LevelSplit};
use playbot_report::counted;
use serde::{Deserialize, Serialize};
use std::{cell::RefCell, collections::BTreeSet, ops::ControlFlow, rc::Rc};

/// Name of the tester that plays the actions which solved the level before.
pub const STORED: &str = "the stored solution";

/// Name of the explorer among testers.
pub const EXPLORER: &str = "explorer";

/// The plan of quick tests, each of one level.
#[derive(Clone)]
pub struct QuickPlan {
    /// Testers, which play one episode each, the quickest first.
    pub testers: Vec<Tester>,
    /// Detectors.
    pub detectors: Detectors,
    /// Environment steps of the explorer.
    pub steps: u64,
    /// Threads.
    pub threads: usize,
}

/// What is known of a level.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct QuickVerdict {
    /// Its outcome; `None` if that is not known yet.
    pub outcome: Option<LevelOutcome>,
    /// The one that solved it in the fewest ticks: [`STORED`], the name of a tester, or [`EXPLORER`].
    pub solved_by: Option<String>,
    /// Ticks of that episode.
    pub ticks: Option<u32>,
    /// Episodes of the testers that the game ended without the goal.
    pub lost: u64,
    /// Episodes whose time was up.
    pub timed_out: u64,
    /// True if each tester reached the goal in its first tick. Older saves lack it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub solved_at_start: bool,
    /// Why the level cannot be solved, if that is proved.
    pub why: Option<String>,
    /// What the stored solution does now, if it no longer solves the level.
    pub stored: Option<String>,
    /// Findings.
    pub findings: Vec<Finding>,
    /// Open squares that the explorer has reached, if it was asked and the level has a plan.
    pub reached: Option<Places>,
    /// The level with the path, as SVG in the colours of reports; `None` without a plan.
    pub picture: Option<String>,
    /// Whether no other tester will play.
    pub is_final: bool,
}

/// The verdict, and the actions that solve the level.
#[derive(Clone, Debug, PartialEq)]
pub struct QuickResult {
    /// The verdict.
    pub verdict: QuickVerdict,
    /// Actions that solve the level, if they are known.
    pub solution: Option<Vec<ActionValue>>,
}

/// A way through a level.
#[derive(Default)]
struct Way {
    by: String,
    actions: Vec<ActionValue>,
    positions: Vec<Vec2>,
}

/// Judges a level, which `split` names. `solution` are actions that solved it before, in this or another form. `progress`
/// receives what is known after each tester. `None` if `stop` returned true.
///
/// # Errors
///
/// The plan tests nothing, or the game cannot be played.
pub fn judge_quickly(
    game: &dyn Game,
    plan: &QuickPlan,
    split: &LevelSplit,
    solution: Option<&[ActionValue]>,
    progress: &mut dyn FnMut(&QuickVerdict),
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Option<QuickResult>, TestError> {
    let (mode, level) = (split.mode.as_str(), split.first);
    let floor = game.tools().levels.floor_plan(mode, level);
    let setting = |seed| PlayedSetting { game, mode, level, seed };
    let mut known = QuickVerdict::default();
    let mut ways: Vec<Way> = Vec::new();
    if let Some(actions) = solution {
        let (replayed, positions) = walked(setting(0), actions);
        if is_solved(&replayed) {
            let actions = actions[..replayed.actions.len().min(actions.len())].to_vec();
            ways.push(Way { by: STORED.to_owned(), actions, positions });
        } else {
            known.stored = Some(end_in_words(&replayed));
            known.picture = floor.as_ref().and_then(|floor| picture(floor, &[], &positions, None));
        }
        if note_best(&mut known, &ways, floor.as_ref()) || known.stored.is_some() {
            progress(&known);
        }
    }
    if stop() {
        return Ok(None);
    }
    let Some((tested, won)) = test(game, plan, split, stop)? else { return Ok(None) };
    for (tester, actions) in won {
        let (replayed, positions) = walked(setting(0), &actions);
        // A game that does not repeat itself has no way to show.
        let positions = if is_solved(&replayed) { positions } else { Vec::new() };
        ways.push(Way { by: tester, actions, positions });
    }
    known.lost = tested.score.lost;
    known.timed_out = tested.score.timed_out;
    known.solved_at_start = tested.solved_at_start;
    known.why = tested.proof.why_unsolvable().map(str::to_owned);
    known.outcome = Some(tested.outcome);
    known.findings = tested.findings;
    note_best(&mut known, &ways, floor.as_ref());
    if !ways.is_empty() {
        return Ok(Some(finished(known, ways)));
    }
    progress(&known);
    let explored = match explore(game, plan, split, stop) {
        Ok(Some(explored)) => explored,
        Ok(None) => return Ok(None),
        // The test has found the same, or the game is one that cannot be explored.
        Err(error) => {
            known.findings.extend(unexplored(&known, &error));
            // The level itself, if there is nothing else to show.
            let empty = || floor.as_ref().and_then(|floor| picture(floor, &[], &[], None));
            known.picture = known.picture.or_else(empty);
            return Ok(Some(finished(known, ways)));
        }
    };
    if let Some(route) = explored.solution() {
        let actions: Vec<ActionValue> = (0..route.len()).filter_map(|tick| route.actions.get(tick)).collect();
        let (_, positions) = walked(setting(0), &actions);
        ways.push(Way { by: EXPLORER.to_owned(), actions, positions });
        note_best(&mut known, &ways, floor.as_ref());
        return Ok(Some(finished(known, ways)));
    }
    let open = explored.open.as_ref().map(BTreeSet::len);
    known.reached =
        open.zip(explored.open_reached()).map(|(open, visited)| Places { visited: visited as u64, open: open as u64 });
    let drawn = |floor: &FloorPlan| picture(floor, &[], &[], Reached::of(&explored, floor).as_ref());
    known.picture = floor.as_ref().and_then(drawn);
    Ok(Some(finished(known, ways)))
}

fn finished(known: QuickVerdict, mut ways: Vec<Way>) -> QuickResult {
    ways.sort_by_key(|way| way.actions.len());
    let solution = ways.into_iter().next().map(|way| way.actions);
    QuickResult { verdict: QuickVerdict { is_final: true, ..known }, solution }
}

/// Notes the shortest way. Returns whether there is one.
fn note_best(known: &mut QuickVerdict, ways: &[Way], floor: Option<&FloorPlan>) -> bool {
    let Some(best) = ways.iter().min_by_key(|way| way.actions.len()) else { return false };
    known.outcome = Some(LevelOutcome::Solved);
    known.solved_by = Some(best.by.clone());
    known.ticks = u32::try_from(best.actions.len()).ok();
    known.picture = floor.and_then(|floor| picture(floor, &best.positions, &[], None));
    true
}

/// Returns the finding of a level that could not be explored, unless the same is found already.
fn unexplored(known: &QuickVerdict, error: &ExploreError) -> Option<Finding> {
    let is_new = !matches!(error, ExploreError::Fault(_)) || known.findings.is_empty();
    is_new.then(|| Finding {
        detector: "unexplored".to_owned(),
        tester: Some(EXPLORER.to_owned()),
        episode: None,
        tick: None,
        message: error.to_string(),
        file: None,
        settings: Vec::new(),
    })
}

/// The verdict of the testers, and the actions of each that solved the level.
type Tested = (LevelVerdict, Vec<(String, Vec<ActionValue>)>);

/// Tests the level as `playbot test` does.
fn test(
    game: &dyn Game,
    plan: &QuickPlan,
    split: &LevelSplit,
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Option<Tested>, TestError> {
    let whole = TestPlan {
        split: LevelSplit { last: split.first, ..split.clone() },
        testers: plan.testers.clone(),
        episodes: 1,
        seed: 0,
        detectors: plan.detectors.clone(),
        shard: None,
        threads: plan.threads,
    };
    let mut verdicts = Vec::new();
    let mut keep = |verdict: LevelVerdict| {
        verdicts.push(verdict);
        Ok(())
    };
    let watch = TestObserver { progress: &|_| {}, stop };
    run_tests_keeping(game, &whole, &BTreeSet::new(), &mut keep, &watch, None)?;
    let Some(verdict) = verdicts.pop() else { return Ok(None) };
    let name = level_name(game, &whole.split, split.first);
    let solved = verdict.testers.iter().zip(&whole.testers).filter(|(found, _)| found.score.solved > 0);
    let won = solved.filter_map(|(_, Tester { record, player, observation_config })| {
        let seed = whole.episode_seed(record, &name, 0);
        let setting = PlayedSetting { game, mode: &split.mode, level: split.first, seed };
        let (actions, replayed) = play_player(setting, player, observation_config).ok()?;
        is_solved(&replayed).then(|| (record.name.clone(), actions))
    });
    let won = won.collect();
    Ok(Some((verdict, won)))
}

fn explore(
    game: &dyn Game,
    plan: &QuickPlan,
    split: &LevelSplit,
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Option<Exploration>, ExploreError> {
    let plan = ExplorePlan {
        steps: plan.steps,
        until: Until::Solved,
        threads: plan.threads,
        keeps_panics: false,
        ..ExplorePlan::new(split.mode.clone(), split.first)
    };
    let explored = explore_until(game, &plan, |_| {}, |_| ControlFlow::Continue(()), stop)?;
    Ok((!stop()).then_some(explored))
}

/// Plays actions, and returns the position after each tick as well, if the game reports them.
fn walked(setting: PlayedSetting, actions: &[ActionValue]) -> (Replayed, Vec<Vec2>) {
    let noted = Rc::new(RefCell::new(Vec::new()));
    let positions = Rc::clone(&noted);
    let watcher: Watcher = Box::new(move |moment: &CheckTick| {
        let position = moment.game.tools().state.position(moment.world, moment.agent);
        positions.borrow_mut().extend(position.filter(|position| position.is_finite()));
        None
    });
    let replayed = play_actions(setting, actions, Some(watcher));
    let positions = noted.take();
    (replayed, positions)
}

fn is_solved(replayed: &Replayed) -> bool {
    replayed.broken.is_none() && replayed.end.is_some_and(|end| end.success)
}

/// Says how the actions end that no longer solve the level.
fn end_in_words(replayed: &Replayed) -> String {
    let ticks = counted(replayed.rewards.len() as u64, "tick");
    match (&replayed.broken, replayed.end.map(|end| end.end)) {
        (Some(_), _) => format!("breaks the game after {ticks}"),
        (None, Some(EpisodeEnd::Truncated)) => format!("runs out of time after {ticks}"),
        (None, Some(EpisodeEnd::Terminated { .. })) => format!("is lost after {ticks}"),
        (None, None) => format!("does not reach the goal in its {ticks}"),
    }
}
