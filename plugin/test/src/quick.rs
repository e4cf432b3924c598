//! The verdict on a level while it is drawn: as soon as possible, with the path that solves it.
//!
//! [`judge_quickly`] asks the quickest first: the actions that solved the level before, then testers, as a
//! [test](crate::verdict) does, and an explorer if none of them solves it. What is known so far is handed to the caller
//! after each of them.

use crate::{
    detectors::Detectors,
    explore::{Exploration, ExploreError, ExplorePlan, Until, explore_until},
    findings::{CheckTick, PlayedSetting, Replayed, Watcher, play_actions, play_player},
    verdict::{
        Finding, LevelOutcome, LevelVerdict, Places, TestError, TestObserver, TestPlan, Tester, maps::level_name,
        run_tests_keeping,
    },
    verdict_report::{Grid, HATCH, Reached, floor as draw_floor, shape, start_and_goal},
};
use bevy::math::{Rect, Vec2};
use bevy_playbot::{action::ActionValue, episode::EpisodeEnd};
use playbot_harness::{floor_plan::FloorPlan, game::Game, split::LevelSplit};
use playbot_report::counted;
use serde::{Deserialize, Serialize};
use std::{cell::RefCell, collections::BTreeSet, fmt::Write, ops::ControlFlow, rc::Rc};

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

// The picture of a level with a path through it, or with the places that were not reached.

/// Most points of a way. Of more, evenly spaced ones are drawn.
const MOST_POINTS: usize = 400;

/// Largest size of what an explorer has reached, bytes: a page of a watch has one picture.
const MOST_BYTES: usize = 200_000;

/// Share of the plan by which the picture may be larger, for agents that leave it.
const BEYOND: f32 = 0.5;

/// Returns the picture: the way that solves the level, the way of a solution that no longer does, and what an explorer has
/// reached. `None` for a plan without extent.
pub(super) fn picture(floor: &FloorPlan, way: &[Vec2], lost: &[Vec2], reached: Option<&Reached>) -> Option<String> {
    let grid = Grid::new(extent(floor.bounds, way.iter().chain(lost)))?;
    let [width, height] = grid.size();
    let mut svg = format!("<svg class=\"level\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"level\">");
    if reached.is_some() {
        svg += HATCH;
    }
    svg += &reached.map_or_else(String::new, |reached| reached.svg(&grid, MOST_BYTES));
    draw_floor(floor, &grid, &mut svg);
    for (class, positions) in [("way", way), ("way lost-way", lost)] {
        line(&grid, class, floor.start, positions, &mut svg);
    }
    if let Some([x, y]) = lost.last().and_then(|at| grid.place(*at)) {
        shape("mark", None, &format!("M{} {}l14 14m0-14l-14 14", x - 7, y - 7), &mut svg);
    }
    start_and_goal(floor, &grid, &mut svg);
    svg += "</svg>";
    Some(svg)
}

/// Returns the drawn area: the plan, with room for a way that leaves it.
fn extent<'a>(bounds: Rect, positions: impl Iterator<Item = &'a Vec2>) -> Rect {
    let most = bounds.inflate(BEYOND * bounds.size().max_element());
    let finite = positions.filter(|position| position.is_finite());
    finite.fold(bounds, |extent, position| extent.union_point(position.clamp(most.min, most.max)))
}

/// Draws a way from the start through positions.
fn line(grid: &Grid, class: &str, start: Vec2, positions: &[Vec2], svg: &mut String) {
    if positions.is_empty() {
        return;
    }
    let every = positions.len().div_ceil(MOST_POINTS);
    let last = positions.last().filter(|_| !(positions.len() - 1).is_multiple_of(every));
    let points = [start].into_iter().chain(positions.iter().copied().step_by(every)).chain(last.copied());
    let mut d = String::new();
    for [x, y] in points.filter_map(|at| grid.place(at)) {
        let _ = write!(d, "{}{x} {y}", if d.is_empty() { 'M' } else { 'L' });
    }
    shape(class, None, &d, svg);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::LevelMaps;

    fn floor() -> FloorPlan {
        FloorPlan {
            bounds: Rect::new(0.0, 0.0, 64.0, 16.0),
            walls: vec![Rect::new(0.0, 0.0, 64.0, 1.0)],
            start: Vec2::new(1.5, 1.5),
            goal: Vec2::new(60.5, 1.5),
            ..FloorPlan::default()
        }
    }

    #[test]
    fn a_way_begins_at_the_start_and_ends_at_the_last_position() {
        let way: Vec<Vec2> = (0..1000_u16).map(|tick| Vec2::new(1.5 + f32::from(tick) * 0.059, 1.5)).collect();
        let svg = picture(&floor(), &way, &[], None).expect("an extent");
        assert!(svg.contains("<path class=\"way\" d=\"M15 145L") && svg.contains("L604 145\"/>"), "{svg}");
        assert!(svg.len() < 8_000 && !svg.contains("lost-way") && !svg.contains("mark"), "{svg}");
    }

    #[test]
    fn a_way_that_is_lost_ends_with_a_cross_and_unreached_places_are_shown() {
        let svg = picture(&floor(), &[], &[Vec2::new(10.0, 2.0)], None).expect("an extent");
        assert!(svg.contains("class=\"way lost-way\" d=\"M15 145L100 140\"") && svg.contains("M93 133l14 14"), "{svg}");
        let maps = LevelMaps { side: 1.0, columns: 64, rows: 16, visits: vec![[65, 4]], ..LevelMaps::default() };
        let reached = Reached::by_testers(&maps, &floor()).expect("open squares");
        let svg = picture(&floor(), &[], &[], Some(&reached)).expect("an extent");
        assert!(svg.contains("<path class=\"reached\" d=\"M10 140h10v10h-10z\"/>"), "{svg}");
        assert!(svg.contains("<path class=\"missed\" d=\"M0 0h10v150h-10zM10 0h10v140h-10z"), "{svg}");
        assert!(svg.contains("<pattern id=\"hatch\""), "{svg}");
        let high = picture(&floor(), &[Vec2::new(9.0, 20.0), Vec2::new(9.0, 1e9)], &[], None).expect("an extent");
        assert!(
            high.contains("viewBox=\"0 0 640 480\"") && high.contains("L90 280"),
            "a way may leave the plan: {high}"
        );
        assert_eq!(picture(&FloorPlan { bounds: Rect::default(), ..floor() }, &[], &[], None), None);
    }
}
