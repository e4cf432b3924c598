//! The exploration from its first round to its last.

use std::{collections::BTreeSet, ops::ControlFlow};

use playbot_learner::{Streams, rng::ChaCha8Rng};

use super::{
    archive::Archive,
    cell::Cell,
    error::ExploreError,
    exploration::{EndCounts, Exploration, Stop},
    grid::CellGrid,
    job::Job,
    lookout::Lookout,
    open_cells::open_cells,
    plan::ExplorePlan,
    until::Until,
    visit::Visited,
    world::ExploreWorld,
};
use crate::{arrangement::Arrangement, game::Game, parallel::on_threads};

/// Longest visit, as a multiple of its patience, if it goes on finding cells.
const LONGEST: u32 = 10;

/// The state of an exploration after a round of visits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Round {
    /// Environment steps so far.
    pub steps: u64,
    /// Cells that were reached.
    pub cells: usize,
    /// Ticks of the shortest solution so far.
    pub solution: Option<u32>,
}

/// The tasks of a World in a round.
struct Crew<'a> {
    world: ExploreWorld<'a>,
    jobs: Vec<Job>,
}

/// Explores a level. `progress` receives the ticks of each visit, from several threads. `after_round` may end the
/// exploration, whose result is then that of the last finished round.
///
/// The same plan has the same result for any number of threads, arenas and Worlds.
///
/// # Errors
///
/// The plan does not fit the game, or the game breaks its contract or does not replay: see [`ExploreError`].
pub fn explore(
    game: &dyn Game,
    plan: &ExplorePlan,
    progress: impl Fn(u64) + Sync,
    mut after_round: impl FnMut(Round) -> ControlFlow<()>,
) -> Result<Exploration, ExploreError> {
    plan.check(game)?;
    let floor_plan = game.tools().levels.floor_plan(&plan.mode, plan.level);
    let grid = CellGrid::new(floor_plan.as_ref(), plan.cell_size);
    let open = floor_plan.as_ref().and_then(|floor_plan| open_cells(floor_plan, &grid));
    let tile = CellGrid::new(floor_plan.as_ref(), None).size;
    let mut crews = build_crews(game, plan, Lookout::new(grid, plan.cell_size, open.as_ref(), tile))?;
    let mut chance = Streams::new(plan.seed).stream("explore/choose", 0);
    let mut archive = Archive::new(game.actions());
    let (mut steps, mut visits, mut ends) = (0, 0, EndCounts::default());
    let mut curve = Vec::new();
    let stop = loop {
        let jobs = choose_jobs(plan, &archive, &mut chance, steps, visits);
        if jobs.is_empty() {
            break Stop::Spent;
        }
        visits += jobs.len() as u64;
        for visited in play_round(&mut crews, jobs, plan.threads, &archive, &progress)? {
            steps += visited.steps;
            ends.count(visited.end);
            archive.merge(visited);
        }
        let round =
            Round { steps, cells: archive.cells().len(), solution: archive.solution().map(|solution| solution.ticks) };
        curve.push((steps, round.cells as u64));
        if after_round(round).is_break() {
            break Stop::Asked;
        }
        let open = open.as_ref().filter(|_| has_places(&crews));
        if let Some(stop) = stop_of(plan.until, &archive, open, floor_plan.is_some()) {
            break stop;
        }
    };
    let grid = has_places(&crews).then_some(grid);
    // They borrow the open cells, which are part of the result.
    drop(crews);
    Ok(Exploration {
        mode: plan.mode.clone(),
        level: plan.level,
        seed: plan.seed,
        explorer: plan.explorer.describe(),
        steps,
        visits,
        ends,
        curve,
        stop,
        grid,
        has_goal: floor_plan.is_some(),
        open: open.filter(|_| grid.is_some()),
        archive,
    })
}

/// Returns whether cells are squares of the grid, which is equal for all Worlds.
fn has_places(crews: &[Crew<'_>]) -> bool {
    crews.iter().any(|crew| crew.world.has_places())
}

/// Builds the Worlds of agents. Games that are rebuilt for each episode have one agent in each, since others would have
/// to wait for it.
fn build_crews<'a>(
    game: &'a dyn Game,
    plan: &'a ExplorePlan,
    lookout: Lookout<'a>,
) -> Result<Vec<Crew<'a>>, ExploreError> {
    let worlds = if game.built_anew().is_some() { plan.arenas } else { plan.worlds.min(plan.arenas) };
    let arrangement = Arrangement::new(game, plan.arenas, worlds);
    let mut crews = Vec::new();
    for first in arrangement.first_agents() {
        let world = ExploreWorld::new(game, plan, lookout, first, arrangement.arenas)?;
        crews.push(Crew { world, jobs: Vec::new() });
    }
    Ok(crews)
}

/// Draws the visits of a round, within the budget.
fn choose_jobs(plan: &ExplorePlan, archive: &Archive, chance: &mut ChaCha8Rng, steps: u64, visits: u64) -> Vec<Job> {
    let mut left = plan.steps.saturating_sub(steps);
    let mut jobs: Vec<Job> = Vec::new();
    for destination in archive.choose(plan.batch as usize, chance) {
        let beyond = left.saturating_sub(u64::from(destination.way.ticks));
        let patience = plan.explore_ticks.min(u32::try_from(beyond).unwrap_or(u32::MAX));
        if patience == 0 {
            continue;
        }
        left = beyond - u64::from(patience);
        jobs.push(Job {
            number: visits + jobs.len() as u64,
            route: archive.route(destination.way),
            destination,
            patience,
            most: patience.saturating_mul(LONGEST),
        });
    }
    jobs
}

/// Makes all visits of a round, and returns their results in order.
fn play_round(
    crews: &mut [Crew<'_>],
    jobs: Vec<Job>,
    threads: usize,
    archive: &Archive,
    progress: &(impl Fn(u64) + Sync),
) -> Result<Vec<Visited>, ExploreError> {
    let count = crews.len();
    for (index, job) in jobs.into_iter().enumerate() {
        crews[index % count].jobs.push(job);
    }
    let parts = on_threads(crews, threads, |crew| {
        let jobs = std::mem::take(&mut crew.jobs);
        crew.world.play(jobs, archive, progress)
    });
    let mut all = Vec::new();
    for part in parts {
        all.extend(part?);
    }
    all.sort_by_key(|(number, _)| *number);
    Ok(all.into_iter().map(|(_, visited)| visited).collect())
}

/// Returns the reason to stop, if there is one.
fn stop_of(until: Until, archive: &Archive, open: Option<&BTreeSet<Cell>>, has_goal: bool) -> Option<Stop> {
    let is_solved = archive.solution().is_some();
    let is_covered = || open.is_some_and(|open| open.iter().all(|cell| archive.cells().contains_key(cell)));
    match until {
        Until::Solved => is_solved.then_some(Stop::Solved),
        Until::Covered => ((is_solved || !has_goal) && is_covered()).then_some(Stop::Covered),
        Until::Spent => None,
    }
}
