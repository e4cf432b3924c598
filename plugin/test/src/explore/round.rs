//! The exploration from its first round to its last.

use crate::explore::{
    EndCounts, Exhaustion, Exploration, ExploreError, ExplorePlan, Stop, Until,
    archive::{Archive, Destination, Draws, Job, Visit, Visited},
    cell::{CellGrid, ExploredCell, Lookout, tile_size},
    known_paths::{Route, SnapshotFault},
};
use bevy::{
    math::{Rect, Vec2},
    prelude::*,
};
use bevy_playbot::{
    agent::Control,
    demo::replay::Divergence,
    engine::{panics::PanicReports, tick_world},
    vision::VisionError,
};
use playbot_harness::{
    floor_plan::FloorPlan,
    game::Game,
    parallel::on_threads,
    saved_episode::SavedEpisode,
    worlds::{Arrangement, EndedEpisodes, arenas_within, build_observing_world, is_bound_to_its_thread},
};
use playbot_learner::{Streams, rng::ChaCha8Rng};
use std::{
    collections::{BTreeSet, VecDeque},
    ops::ControlFlow,
};

/// Longest visit, as a multiple of its patience, if it goes on finding cells.
const LONGEST: u32 = 10;

/// Of so many visits that may use snapshots one is checked by a replay.
const CHECKED: u64 = 32;

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

/// Explores a level as [`explore_until`] does, without a stop within a round.
///
/// # Errors
///
/// As for [`explore_until`].
pub fn explore(
    game: &dyn Game,
    plan: &ExplorePlan,
    progress: impl Fn(u64) + Sync,
    after_round: impl FnMut(Round) -> ControlFlow<()>,
) -> Result<Exploration, ExploreError> {
    explore_until(game, plan, progress, after_round, &|| false)
}

/// Explores a level. `progress` receives the ticks of each visit, from several threads. `after_round` may end the
/// exploration, whose result is then that of the last finished round. `stop` is asked before each tick, from several
/// threads, and is to return true from the first time on. The result then has what the visits had seen by then, which
/// depends on the moment.
///
/// The same plan has the same result for any number of threads, arenas and Worlds, with and without snapshots. All
/// visits of the first round that uses snapshots are made by replays, too, and later each 32nd one. If one of them
/// differs, the exploration begins anew without snapshots.
///
/// # Errors
///
/// The plan does not fit the game, or the game breaks its contract or does not replay: see [`ExploreError`].
pub fn explore_until(
    game: &dyn Game,
    plan: &ExplorePlan,
    progress: impl Fn(u64) + Sync,
    mut after_round: impl FnMut(Round) -> ControlFlow<()>,
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Exploration, ExploreError> {
    plan.check(game)?;
    let hooks = Hooks { progress: &progress, stop };
    // Skills, and stacks of pictures, are no part of a snapshot. A World that is built anew has none either.
    let mut has_snapshots = plan.snapshots && !plan.explorer.is_policy() && game.built_anew().is_none();
    let mut snapshot_fault = None;
    loop {
        match search(game, plan, has_snapshots, hooks, &mut after_round)? {
            Attempt::Done(exploration) => return Ok(Exploration { snapshot_fault, ..*exploration }),
            Attempt::Distrusted(fault) => (has_snapshots, snapshot_fault) = (false, Some(fault)),
        }
    }
}

/// The caller's functions that are called within a round.
#[derive(Clone, Copy)]
struct Hooks<'a> {
    /// Receives the ticks of each visit.
    progress: &'a (dyn Fn(u64) + Sync),
    /// Returns whether to stop.
    stop: &'a (dyn Fn() -> bool + Sync),
}

/// The outcome of a whole exploration.
enum Attempt {
    Done(Box<Exploration>),
    /// A snapshot does not restore everything.
    Distrusted(SnapshotFault),
}

fn search(
    game: &dyn Game,
    plan: &ExplorePlan,
    has_snapshots: bool,
    hooks: Hooks<'_>,
    after_round: &mut impl FnMut(Round) -> ControlFlow<()>,
) -> Result<Attempt, ExploreError> {
    let floor_plan = game.tools().levels.floor_plan(&plan.mode, plan.level);
    let grid = CellGrid::new(floor_plan.as_ref(), plan.cell_size);
    let open = floor_plan.as_ref().and_then(|floor_plan| open_cells(floor_plan, &grid));
    let tile = CellGrid::new(floor_plan.as_ref(), None).size;
    let mut crews = build_crews(game, plan, Lookout::new(grid, plan.cell_size, open.as_ref(), tile), has_snapshots)?;
    let mut chance = Streams::new(plan.seed).stream("explore/choose", 0);
    let mut archive = Archive::new(game.actions());
    let (mut steps, mut restored_steps, mut visits, mut ends) = (0, 0, 0, EndCounts::default());
    let mut curve = Vec::new();
    let mut has_restored = false;
    let stop = loop {
        let jobs = choose_jobs(plan, &archive, &mut chance, steps, visits);
        if jobs.is_empty() {
            break Stop::Spent;
        }
        let round = Jobs { game, plan, archive: &archive, jobs };
        let visited = match round.play(&mut crews, &mut has_restored, hooks)? {
            Ok(visited) => visited,
            Err(fault) => return Ok(Attempt::Distrusted(fault)),
        };
        visits += visited.len() as u64;
        for visited in visited {
            steps += visited.steps;
            restored_steps += u64::from(visited.restored);
            ends.count(visited.end);
            archive.merge(visited);
        }
        let round =
            Round { steps, cells: archive.cells().len(), solution: archive.solution().map(|solution| solution.ticks) };
        curve.push((steps, round.cells as u64));
        if after_round(round).is_break() || (hooks.stop)() {
            break Stop::Asked;
        }
        let open = open.as_ref().filter(|_| has_positions(&crews));
        if let Some(stop) = stop_of(plan.until, &archive, open, floor_plan.is_some()) {
            break stop;
        }
    };
    let grid = has_positions(&crews).then_some(grid);
    let obstacle = |crew: &Crew<'_>| game.tools().snapshots.obstacle(&crew.world.world);
    let snapshot_obstacle = if has_snapshots { crews.iter().find_map(obstacle) } else { None };
    let rests_on = crews.iter().find_map(|crew| crew.world.lookout.describe());
    // They borrow the open cells, which are part of the result.
    drop(crews);
    let exhausted =
        archive.exhausted().zip(rests_on).map(|((actions, cells), rests_on)| Exhaustion { actions, cells, rests_on });
    Ok(Attempt::Done(Box::new(Exploration {
        mode: plan.mode.clone(),
        level: plan.level,
        seed: plan.seed,
        explorer: plan.explorer.describe(),
        steps,
        restored_steps,
        snapshot_fault: None,
        snapshot_obstacle,
        visits,
        ends,
        curve,
        stop,
        grid,
        has_goal: floor_plan.is_some(),
        open: open.filter(|_| grid.is_some()),
        exhausted,
        archive,
    })))
}

/// Returns whether cells are squares of the grid, which is equal for all Worlds.
fn has_positions(crews: &[Crew<'_>]) -> bool {
    crews.iter().any(|crew| crew.world.has_positions())
}

/// Builds the Worlds of agents. Games that are rebuilt for each episode have one agent in each, since others would have
/// to wait for it.
fn build_crews<'a>(
    game: &'a dyn Game,
    plan: &'a ExplorePlan,
    lookout: Lookout<'a>,
    has_snapshots: bool,
) -> Result<Vec<Crew<'a>>, ExploreError> {
    let worlds = if game.built_anew().is_some() { plan.arenas } else { plan.worlds.min(plan.arenas) };
    let arrangement = Arrangement::new(game, arenas_within(game, plan.arenas, worlds), worlds);
    let mut crews = Vec::new();
    for first in arrangement.first_agents() {
        let mut world = ExploreWorld::new(game, plan, lookout, first, arrangement.arenas)?;
        world.has_snapshots = has_snapshots;
        if has_snapshots {
            SavedEpisode::prepare(game, &mut world.world);
        }
        crews.push(Crew { world, jobs: Vec::new() });
    }
    Ok(crews)
}

/// Draws the visits of a round, within the budget.
fn choose_jobs(plan: &ExplorePlan, archive: &Archive, chance: &mut ChaCha8Rng, steps: u64, visits: u64) -> Vec<Job> {
    let mut left = plan.steps.saturating_sub(steps);
    let mut jobs: Vec<Job> = Vec::new();
    for destination in archive.choose(plan.batch as usize, chance) {
        let beyond = left.saturating_sub(u64::from(destination.path.ticks));
        let patience = plan.explore_ticks.min(u32::try_from(beyond).unwrap_or(u32::MAX));
        if patience == 0 {
            continue;
        }
        left = beyond - u64::from(patience);
        jobs.push(Job {
            number: visits + jobs.len() as u64,
            route: archive.route(destination.path),
            saved: archive.nearest(destination.path),
            destination,
            patience,
            most: patience.saturating_mul(LONGEST),
        });
    }
    jobs
}

/// The visits of a round.
struct Jobs<'a> {
    game: &'a dyn Game,
    plan: &'a ExplorePlan,
    archive: &'a Archive,
    jobs: Vec<Job>,
}

impl Jobs<'_> {
    /// Makes the visits. Some of those that use snapshots are made by replays, too, and compared.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or does not replay. The inner error is a difference that snapshots have made.
    fn play(
        self,
        crews: &mut [Crew<'_>],
        has_restored: &mut bool,
        hooks: Hooks<'_>,
    ) -> Result<Result<Vec<Visited>, SnapshotFault>, ExploreError> {
        let Self { game, plan, archive, jobs } = self;
        let threads = plan.threads;
        if jobs.iter().all(|job| job.saved.is_none()) {
            return play_round(crews, jobs, threads, archive, hooks).map(Ok);
        }
        let is_first = !std::mem::replace(has_restored, true);
        let is_checked = |job: &Job| is_first || (job.saved.is_some() && job.number.is_multiple_of(CHECKED));
        let checked = jobs.iter().enumerate().filter(|(_, job)| is_checked(job));
        let (places, replays): (Vec<usize>, Vec<Job>) =
            checked.map(|(place, job)| (place, Job { saved: None, ..job.clone() })).unzip();
        let fault = |tick| Ok(Err(SnapshotFault { game: game.name(), level: plan.level, tick }));
        let restored = match play_round(crews, jobs, threads, archive, hooks) {
            Ok(restored) => restored,
            // If the game itself is at fault, replays show it.
            Err(ExploreError::Diverged { divergence, .. }) => return fault(Some(divergence.tick)),
            Err(_) => return fault(None),
        };
        let replayed = play_round(crews, replays, threads, archive, Hooks { progress: &|_| {}, ..hooks })?;
        if (hooks.stop)() {
            // There may be nothing to compare with. Nothing is known of snapshots before they were compared once.
            let is_kept = |visited: &Visited| !is_first || visited.restored == 0;
            return Ok(Ok(restored.into_iter().filter(is_kept).collect()));
        }
        let mut pairs = places.into_iter().zip(&replayed);
        let difference = pairs.find_map(|(place, replayed)| restored[place].first_difference(replayed));
        if difference.is_some() { fault(difference) } else { Ok(Ok(restored)) }
    }
}

/// Makes all visits of a round, and returns their results in order. If the caller stops, those of the visits that had
/// explored something by then are returned.
fn play_round(
    crews: &mut [Crew<'_>],
    jobs: Vec<Job>,
    threads: usize,
    archive: &Archive,
    hooks: Hooks<'_>,
) -> Result<Vec<Visited>, ExploreError> {
    let count = crews.len();
    let threads = if crews.iter().any(|crew| crew.world.is_bound_to_its_thread()) { 1 } else { threads };
    for (index, job) in jobs.into_iter().enumerate() {
        crews[index % count].jobs.push(job);
    }
    let parts = on_threads(crews, threads, |crew| {
        let jobs = std::mem::take(&mut crew.jobs);
        crew.world.play(jobs, archive, hooks)
    });
    let mut all = Vec::new();
    for part in parts {
        all.extend(part?);
    }
    all.sort_by_key(|(number, _)| *number);
    Ok(all.into_iter().map(|(_, visited)| visited).collect())
}

/// Returns the reason to stop, if there is one.
fn stop_of(until: Until, archive: &Archive, open: Option<&BTreeSet<ExploredCell>>, has_goal: bool) -> Option<Stop> {
    let is_solved = archive.solution().is_some();
    let is_covered = || open.is_some_and(|open| open.iter().all(|cell| archive.cells().contains_key(cell)));
    match until {
        Until::Solved => is_solved.then_some(Stop::Solved),
        Until::Covered => ((is_solved || !has_goal) && is_covered()).then_some(Stop::Covered),
        Until::Exhausted => archive.exhausted().map(|_| Stop::Exhausted),
        Until::Spent => None,
    }
}

/// Some arenas of an exploration.
pub(super) struct ExploreWorld<'a> {
    game: &'a dyn Game,
    mode: &'a str,
    level: u64,
    world: World,
    agents: Vec<Entity>,
    draws: Draws,
    lookout: Lookout<'a>,
    /// Whether snapshots are saved.
    has_snapshots: bool,
}

impl<'a> ExploreWorld<'a> {
    /// Builds agents `first..first + count`, all idle.
    ///
    /// # Errors
    ///
    /// The observation of the explorer's policy cannot be drawn.
    pub fn new(
        game: &'a dyn Game,
        plan: &'a ExplorePlan,
        lookout: Lookout<'a>,
        first: u32,
        count: u32,
    ) -> Result<Self, VisionError> {
        let (mut world, agents) = build_observing_world(game, &plan.mode, &plan.observation_config, 0, first, count)?;
        EndedEpisodes::note_in(&mut world);
        if let Some(mut reports) = world.get_resource_mut::<PanicReports>().filter(|_| !plan.keeps_panics) {
            reports.keep_no_files();
        }
        plan.explorer.install(&mut world);
        let draws = Draws {
            streams: Streams::new(plan.seed),
            sticky: plan.sticky,
            is_policy: plan.explorer.is_policy(),
            space: game.actions(),
        };
        Ok(Self { game, mode: &plan.mode, level: plan.level, world, agents, draws, lookout, has_snapshots: false })
    }

    /// Returns whether cells are squares of the grid.
    pub fn has_positions(&self) -> bool {
        self.lookout.has_positions()
    }

    /// Returns whether only the thread that built the World may tick it.
    pub fn is_bound_to_its_thread(&self) -> bool {
        is_bound_to_its_thread(&self.world)
    }

    /// Makes visits, several of them at a time, or as many as there is time for until the caller stops.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or does not replay.
    fn play(
        &mut self,
        jobs: Vec<Job>,
        archive: &Archive,
        hooks: Hooks<'_>,
    ) -> Result<Vec<(u64, Visited)>, ExploreError> {
        let mut jobs = jobs.into_iter();
        let mut visits: Vec<Option<Visit>> = self.agents.iter().map(|_| None).collect();
        let mut done = Vec::new();
        let finished = |visit: Visit| {
            let (number, visited) = visit.finish();
            (hooks.progress)(visited.steps);
            (number, visited)
        };
        loop {
            if (hooks.stop)() {
                done.extend(visits.into_iter().flatten().filter(Visit::has_explored).map(finished));
                return Ok(done);
            }
            for (visit, &agent) in visits.iter_mut().zip(&self.agents) {
                let (game, mode) = (self.game, self.mode);
                if visit.is_none()
                    && let Some(job) = jobs.next()
                {
                    let mut begun = Visit::begin(job, self.level, &self.draws, &mut self.world.entity_mut(agent));
                    if begun.restore(game, &mut self.world, agent) {
                        let (world, lookout) = (&self.world, &mut self.lookout);
                        let spot = |ticks, before| lookout.spot(game, world, agent, ticks, before);
                        begun.look_around(archive, spot).map_err(|divergence| diverged(game, mode, divergence))?;
                    }
                    *visit = Some(begun);
                }
                let mut entity = self.world.entity_mut(agent);
                match visit {
                    Some(visit) => visit.act(&self.draws, &mut entity),
                    None => {
                        entity.insert(Control::Idle);
                    }
                }
            }
            if visits.iter().all(Option::is_none) {
                return Ok(done);
            }
            tick_world(&mut self.world)?;
            let ended = EndedEpisodes::take(&mut self.world);
            for (visit, &agent) in visits.iter_mut().zip(&self.agents) {
                let Some(running) = visit.as_mut() else { continue };
                let end = ended.iter().find(|(entity, _)| *entity == agent).map(|(_, result)| *result);
                let (game, mode, world, lookout) = (self.game, self.mode, &self.world, &mut self.lookout);
                let spot = |ticks, before| lookout.spot(game, world, agent, ticks, before);
                let has_snapshots = self.has_snapshots;
                let save = || if has_snapshots { SavedEpisode::of(game, world, agent) } else { None };
                let is_over = running
                    .note(world, agent, end, archive, spot, save)
                    .map_err(|divergence| diverged(game, mode, divergence))?;
                if let Some(visit) = visit.take_if(|_| is_over) {
                    done.push(finished(visit));
                }
            }
        }
    }
}

fn diverged(game: &dyn Game, mode: &str, divergence: Divergence) -> ExploreError {
    ExploreError::Diverged { game: game.name(), mode: mode.to_owned(), divergence }
}

/// Cells beyond each side of a level that are accepted: agents can be there, for instance above it.
const MARGIN: i64 = 8;

/// Part of a cell by which a level may be longer than its cells, through rounding.
const SLACK: f32 = 1e-3;

/// Plays one tick of the level, and checks a cell. It must have as many numbers as the level's cells, and must not lie
/// far outside. Returns whether it may be reached by the level's plan: false in a wall, and where walls cut it off from
/// the start. Agents may be there all the same, since a position may be that of their feet, and games have faults.
///
/// # Errors
///
/// [`ExploreError::Plan`] with the valid values, or the plan does not fit the game, or the game breaks its contract.
pub fn check_cell(game: &dyn Game, plan: &ExplorePlan, cell: &ExploredCell) -> Result<bool, ExploreError> {
    plan.check(game)?;
    let floor_plan = game.tools().levels.floor_plan(&plan.mode, plan.level);
    let grid = CellGrid::new(floor_plan.as_ref(), plan.cell_size);
    let lookout = Lookout::new(grid, plan.cell_size, None, grid.size);
    let one = ExplorePlan { arenas: 1, worlds: 1, threads: 1, ..plan.clone() };
    let mut world = ExploreWorld::new(game, &one, lookout, 0, 1)?;
    let route = Route::empty(&game.actions());
    let job = Job { number: 0, destination: Destination::START, route, saved: None, patience: 1, most: 1 };
    let visits = world.play(vec![job], &Archive::new(game.actions()), Hooks { progress: &|_| {}, stop: &|| false })?;
    let Some(seen) = visits.iter().find_map(|(_, visited)| visited.seen.keys().next()) else { return Ok(true) };
    if seen.0.len() != cell.0.len() {
        return Err(ExploreError::Plan(format!(
            "cell {cell} has the wrong count of numbers: cells of this level have {}, such as {seen}",
            seen.0.len()
        )));
    }
    match floor_plan {
        Some(floor_plan) if world.has_positions() => {
            check_bounds(&grid, floor_plan.bounds, cell)?;
            Ok(open_cells(&floor_plan, &grid).is_none_or(|open| open.contains(cell)))
        }
        _ => Ok(true),
    }
}

fn check_bounds(grid: &CellGrid, bounds: Rect, cell: &ExploredCell) -> Result<(), ExploreError> {
    let last = (bounds.size() / grid.size - SLACK).ceil().to_array().map(|count| (count as i64 - 1).max(0));
    let is_near = |(number, last): (&i32, i64)| (-MARGIN..=last + MARGIN).contains(&i64::from(*number));
    if cell.0.iter().zip(last).all(is_near) {
        return Ok(());
    }
    let [column, row] = last;
    Err(ExploreError::Plan(format!(
        "cell {cell} lies outside of the level: its cells go from 0,0 to {column},{row}, column and row, from the lower left \
         corner on"
    )))
}

/// Most squares that are examined.
const MOST: f32 = (1 << 20) as f32;

/// Returns the cells of a grid that no wall cuts off from the start of a level. Returns `None` if the plan is too large
/// for such squares, or its start lies in a wall.
///
/// In a maze these are exactly the reachable cells. With gravity or enemies they are a bound: no other cell is
/// reachable, and some of these may be out of reach.
pub fn open_cells(plan: &FloorPlan, grid: &CellGrid) -> Option<BTreeSet<ExploredCell>> {
    let squares = Squares::new(plan, grid)?;
    let start = squares.index_at(plan.start).filter(|index| !squares.is_wall[*index])?;
    let mut reached = vec![false; squares.is_wall.len()];
    reached[start] = true;
    let mut queue = VecDeque::from([start]);
    let mut cells = BTreeSet::new();
    while let Some(index) = queue.pop_front() {
        let (column, row) = (index % squares.columns, index / squares.columns);
        cells.extend(grid.cell_at(squares.centre(column, row)));
        let beside =
            [(column.wrapping_sub(1), row), (column + 1, row), (column, row.wrapping_sub(1)), (column, row + 1)];
        for (column, row) in beside.into_iter().filter(|(column, row)| *column < squares.columns && *row < squares.rows)
        {
            let next = row * squares.columns + column;
            if !squares.is_wall[next] && !reached[next] {
                reached[next] = true;
                queue.push_back(next);
            }
        }
    }
    Some(cells)
}

/// A plan in squares that are as fine as its tiles, or as the cells if these are finer.
struct Squares {
    origin: Vec2,
    side: f32,
    columns: usize,
    rows: usize,
    is_wall: Vec<bool>,
}

impl Squares {
    fn new(plan: &FloorPlan, grid: &CellGrid) -> Option<Self> {
        let side = tile_size(plan).map_or(grid.size, |tile| tile.min(grid.size));
        let count = (plan.bounds.size() / side).round().max(Vec2::ONE);
        let fits = count.x * count.y <= MOST;
        if !fits {
            return None;
        }
        let (columns, rows) = (count.x as usize, count.y as usize);
        let mut squares = Self { origin: plan.bounds.min, side, columns, rows, is_wall: vec![false; columns * rows] };
        for wall in &plan.walls {
            // Those with their middle in the wall.
            let first = ((wall.min - squares.origin) / side - 0.5).ceil().max(Vec2::ZERO);
            let last = ((wall.max - squares.origin) / side - 0.5).floor();
            if last.min_element() < 0.0 {
                continue;
            }
            for row in first.y as usize..=(last.y as usize).min(rows - 1) {
                for column in first.x as usize..=(last.x as usize).min(columns - 1) {
                    squares.is_wall[row * columns + column] = true;
                }
            }
        }
        Some(squares)
    }

    fn index_at(&self, position: Vec2) -> Option<usize> {
        let at = (position - self.origin) / self.side;
        let (column, row) = (at.x as usize, at.y as usize);
        let is_inside = at.min_element() >= 0.0 && column < self.columns && row < self.rows;
        is_inside.then(|| row * self.columns + column)
    }

    fn centre(&self, column: usize, row: usize) -> Vec2 {
        self.origin + (Vec2::new(column as f32, row as f32) + 0.5) * self.side
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::math::{Rect, Vec2};

    #[test]
    fn cells_far_outside_are_refused_with_those_that_there_are() {
        let grid = CellGrid { origin: Vec2::ZERO, size: 0.5 };
        let check =
            |numbers: [i32; 2]| check_bounds(&grid, Rect::new(0.0, 0.0, 5.0, 2.0), &ExploredCell(numbers.to_vec()));
        for near in [[0, 0], [9, 3], [9, 5], [-1, 0]] {
            assert!(check(near).is_ok(), "{near:?}");
        }
        for far in [[90, 3], [3, 90], [-90, 0], [i32::MAX, i32::MIN]] {
            let error = check(far).expect_err("far outside").to_string();
            assert!(error.contains("outside of the level: its cells go from 0,0 to 9,3"), "{error}");
        }
    }

    /// A room of five cells, and a closed one.
    const ROWS: [&str; 5] = ["#######", "#..#..#", "#.##..#", "#..####", "#######"];

    fn plan() -> FloorPlan {
        let square =
            |row: usize, column: usize| Rect::from_center_size(Vec2::new(column as f32, row as f32) - 0.2, Vec2::ONE);
        let is_wall = |row: usize, column: usize| ROWS[row].as_bytes()[column] == b'#';
        FloorPlan::of_tiles([5, 7], is_wall, square, [Vec2::ONE, Vec2::new(2.0, 3.0)])
    }

    fn open(size: Option<f32>) -> BTreeSet<ExploredCell> {
        let plan = plan();
        open_cells(&plan, &CellGrid::new(Some(&plan), size)).expect("a small plan")
    }

    #[test]
    fn cells_behind_walls_are_not_open() {
        let expected = [[1, 1], [1, 2], [1, 3], [2, 1], [2, 3]];
        assert_eq!(open(None), expected.map(|cell| ExploredCell(cell.to_vec())).into_iter().collect());
    }

    #[test]
    fn finer_cells_are_counted_where_there_is_no_wall_and_coarser_ones_where_any_tile_is_open() {
        assert_eq!(open(Some(0.5)).len(), 4 * 5);
        // Columns 0 and 1 of two tiles each, rows 0 and 1.
        assert_eq!(open(Some(2.0)).len(), 4);
    }

    #[test]
    fn a_start_in_a_wall_says_nothing() {
        let plan = FloorPlan { start: Vec2::ZERO, ..plan() };
        assert_eq!(open_cells(&plan, &CellGrid::new(Some(&plan), None)), None);
        assert_eq!(open_cells(&plan, &CellGrid::new(Some(&plan), Some(1e-6))), None, "too many squares");
    }
}
