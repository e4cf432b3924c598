//! The archive of reached cells, with the paths to them.

use crate::explore::{
    cell::{ExploredCell, Spotted},
    known_paths::{KnownPath, KnownPaths, Route, SPACING},
    tried::{Trial, TrialNotes, TriedActions},
};
use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionValue},
    agent::Control,
    bot::uniform,
    demo::replay::Divergence,
    episode::{Episode, EpisodeEnd, EpisodeResult},
    legal::{LegalActions, RedrawsIllegal},
    level::LevelQueue,
    policy::AgentMemory,
    skill_prior::ActiveSkill,
    state_hash::StateHash,
    streams::AgentStreams,
};
use playbot_harness::{game::Game, saved_episode::SavedEpisode};
use playbot_learner::{
    ActionSpace, Streams,
    rng::{ChaCha8Rng, below, unit},
};
use std::{collections::BTreeMap, iter, sync::Arc};

/// A cell that was reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReachedCell {
    path: KnownPath,
    /// Whether the episode was over on arrival, on every path there, so that no path goes on from it.
    pub is_over: bool,
    /// Whether every path there only passes it between two ticks. The path then ends with the tick after the cell.
    pub is_passed: bool,
    /// Visits in which it was seen.
    pub visits: u64,
}

impl ReachedCell {
    /// Returns the ticks of the shortest known path to it. A path on which the episode goes on comes before a shorter
    /// one on which it ends. One that ends in the cell comes before a shorter one that passes it.
    pub fn ticks(&self) -> u32 {
        self.path.ticks
    }

    fn sight(&self) -> Sight {
        Sight { ticks: self.ticks(), is_over: self.is_over, is_passed: self.is_passed }
    }
}

/// The destination of a visit.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Destination {
    /// The cell; `None` for the start of the level, which needs no path.
    pub cell: Option<ExploredCell>,
    pub path: KnownPath,
    /// Whether the path only passes the cell, with the agent behind it at the end.
    pub is_passed: bool,
}

impl Destination {
    /// The start of the level.
    pub const START: Self = Self { cell: None, path: KnownPath::START, is_passed: false };
}

/// All cells, with their paths.
pub(super) struct Archive {
    start: ReachedCell,
    cells: BTreeMap<ExploredCell, ReachedCell>,
    paths: KnownPaths,
    solution: Option<KnownPath>,
    space: ActionSpace,
    tried: TriedActions,
    /// Whether the game hashes its state, so that replays prove something.
    is_hashed: bool,
}

impl Archive {
    /// Creates an archive with the start of a level alone.
    pub fn new(space: ActionSpace) -> Self {
        let start = ReachedCell { path: KnownPath::START, is_over: false, is_passed: false, visits: 0 };
        Self {
            start,
            cells: BTreeMap::new(),
            paths: KnownPaths::new(space),
            solution: None,
            space,
            tried: TriedActions::default(),
            is_hashed: false,
        }
    }

    /// Returns all cells, in their order.
    pub fn cells(&self) -> &BTreeMap<ExploredCell, ReachedCell> {
        &self.cells
    }

    /// Returns the shortest path on which the level's goal was reached.
    pub fn solution(&self) -> Option<KnownPath> {
        self.solution
    }

    /// Returns a whole path.
    pub fn route(&self, path: KnownPath) -> Route {
        self.paths.route(path)
    }

    /// Returns the path to a cell.
    pub fn route_to(&self, cell: &ExploredCell) -> Option<Route> {
        self.cells.get(cell).map(|reached| self.route(reached.path))
    }

    /// Returns the last snapshot on a path.
    pub fn nearest(&self, path: KnownPath) -> Option<Arc<SavedEpisode>> {
        self.paths.nearest(path).cloned()
    }

    /// Returns the number of actions and cells, if every action was tried from every cell in which the episode goes on.
    pub fn exhausted(&self) -> Option<(u32, usize)> {
        let ActionSpace::Discrete(actions) = self.space else { return None };
        let actions = u32::try_from(actions).ok().filter(|_| self.is_hashed)?;
        let mut open = self.cells.iter().filter(|(_, reached)| !reached.is_over).map(|(cell, _)| cell);
        let count = open.clone().count();
        let is_exhausted =
            self.tried.has_all(None, actions) && open.all(|cell| self.tried.has_all(Some(cell), actions));
        is_exhausted.then_some((actions, count))
    }

    /// Returns whether a cell is new, or reached sooner than before.
    pub fn is_news(&self, cell: &ExploredCell, sight: &Sight) -> bool {
        self.cells.get(cell).is_none_or(|known| sight.is_better_than(&known.sight()))
    }

    /// Draws cells to explore from, with the weights of the paper's version without knowledge of the game:
    /// 1/√(visits + 1).
    pub fn choose(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<Destination> {
        let all = iter::once((None, &self.start)).chain(self.cells.iter().map(|(cell, reached)| (Some(cell), reached)));
        let open: Vec<_> = all.filter(|(_, reached)| !reached.is_over).collect();
        let mut sum = 0.0;
        let mut ends = Vec::with_capacity(open.len());
        for (_, reached) in &open {
            sum += 1.0 / ((reached.visits + 1) as f64).sqrt();
            ends.push(sum);
        }
        let mut draw = || {
            let at = unit(rng) * sum;
            let (cell, reached) = open[ends.partition_point(|end| *end <= at).min(open.len() - 1)];
            Destination { cell: cell.cloned(), path: reached.path, is_passed: reached.is_passed }
        };
        (0..count).map(|_| draw()).collect()
    }

    /// Adds the cells of a visit.
    pub fn merge(&mut self, visit: Visited) {
        let Visited { destination, piece, seen, solved, saved, tried, .. } = visit;
        self.is_hashed |= piece.hashes.iter().any(|hash| *hash != 0);
        self.tried.merge(tried);
        if destination.cell.is_none() {
            self.start.visits += 1;
        }
        let solved = solved.filter(|ticks| self.solution.is_none_or(|known| *ticks < known.ticks));
        let news = seen.iter().filter(|(cell, sight)| self.is_news(cell, sight)).map(|(_, sight)| sight.ticks);
        let farthest = news.chain(solved).max();
        let path = farthest.map(|ticks| self.paths.extend(destination.path, &piece, ticks));
        if let Some(path) = path {
            saved.into_iter().filter(|saved| saved.tick() <= path.ticks).for_each(|saved| self.paths.keep(path, saved));
        }
        for (cell, sight) in seen {
            let is_news = self.is_news(&cell, &sight);
            let found = ReachedCell {
                path: path.map_or(destination.path, |path| path.cut(sight.ticks)),
                is_over: sight.is_over,
                is_passed: sight.is_passed,
                visits: 0,
            };
            let reached = self.cells.entry(cell).or_insert(found);
            if is_news {
                *reached = ReachedCell { visits: reached.visits, ..found };
            }
            reached.visits += 1;
        }
        if let (Some(ticks), Some(path)) = (solved, path) {
            self.solution = Some(path.cut(ticks));
        }
    }
}

// Visits of agents.

/// A path back to a cell, and the ticks to explore there.
#[derive(Clone)]
pub(super) struct Job {
    /// Number of the visit in the whole exploration. Its random numbers are derived from it, so that any World may make
    /// it.
    pub number: u64,
    pub destination: Destination,
    /// The path back.
    pub route: Route,
    /// The last snapshot on it.
    pub saved: Option<Arc<SavedEpisode>>,
    /// Ticks to explore without a find.
    pub patience: u32,
    /// Most ticks to explore.
    pub most: u32,
}

/// The moment at which a cell was seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sight {
    /// Ticks of the episode until then.
    pub ticks: u32,
    /// Whether the episode was over.
    pub is_over: bool,
    /// Whether the agent had passed the cell between two ticks, and was behind it.
    pub is_passed: bool,
}

impl Sight {
    /// Returns whether it is a better path to a cell than another one.
    pub fn is_better_than(&self, other: &Self) -> bool {
        let rank = |sight: &Self| (sight.is_over, sight.is_passed, sight.ticks);
        rank(self) < rank(other)
    }
}

/// The result of a visit.
pub(super) struct Visited {
    pub destination: Destination,
    /// The actions after the path to the destination.
    pub piece: Route,
    /// The cells that were seen from the destination on, each by its best path.
    pub seen: BTreeMap<ExploredCell, Sight>,
    /// Ticks after which the level's goal was reached.
    pub solved: Option<u32>,
    /// Ticks of the episode, with the path back.
    pub steps: u64,
    /// Ticks of these that a snapshot has saved.
    pub restored: u32,
    /// The result of the episode, if it ended.
    pub end: Option<EpisodeResult>,
    /// Snapshots after the path to the destination.
    pub saved: Vec<SavedEpisode>,
    /// The actions that were tried from each cell.
    pub tried: TriedActions,
}

impl Visited {
    /// Returns the first tick in which this visit differs from the same one by a replay.
    pub fn first_difference(&self, replayed: &Self) -> Option<u32> {
        let begin = self.destination.path.ticks;
        let hashes = self.piece.hashes.iter().zip(&replayed.piece.hashes);
        if let Some(at) = hashes.clone().position(|(one, other)| one != other) {
            return Some(begin + at as u32);
        }
        let is_same = self.piece == replayed.piece
            && self.seen == replayed.seen
            && self.tried == replayed.tried
            && (self.solved, self.steps, self.end) == (replayed.solved, replayed.steps, replayed.end);
        (!is_same).then_some(begin + hashes.len() as u32)
    }
}

/// The random numbers of actions.
#[derive(Clone, Copy)]
pub(super) struct Draws {
    pub streams: Streams,
    pub sticky: f64,
    /// Whether a policy decides instead.
    pub is_policy: bool,
    pub space: ActionSpace,
}

/// A visit in progress.
pub(super) struct Visit {
    level: u64,
    job: Job,
    visited: Visited,
    /// Ticks of the episode so far.
    ticks: u32,
    /// Ticks left, unless something new is found.
    left: u32,
    /// Position of the agent after the last tick, from the destination on.
    position: Option<Vec2>,
    rng: ChaCha8Rng,
    /// The last random action that was played.
    last: Option<ActionValue>,
    /// The next action.
    next: Option<ActionValue>,
    /// The random number that replaces the next action if it is illegal, for games with masks.
    redraw: Option<u32>,
    /// Whether the goal was reached on the path back.
    was_solved: bool,
    /// The actions from cell to cell.
    notes: TrialNotes,
    /// Whether a cell of this tick is news.
    has_news: bool,
}

impl Visit {
    /// Starts the level for an agent. Its current episode is dropped.
    pub fn begin(job: Job, level: u64, draws: &Draws, agent: &mut EntityWorldMut) -> Self {
        if let Some(mut running) = agent.get_mut::<Episode>() {
            running.abandon();
        }
        // The streams of replays, for games that draw from the streams of their agents.
        agent.insert((Control::Bot, LevelQueue::Always(level), AgentStreams::new(0, 0)));
        agent.remove::<RedrawsIllegal>();
        let destination = job.destination.clone();
        let sight = Sight { ticks: destination.path.ticks, is_over: false, is_passed: destination.is_passed };
        let here = destination.cell.clone().map(|cell| (cell, sight));
        let piece = Route::empty(&draws.space);
        let seen = here.into_iter().collect();
        let visited = Visited {
            destination,
            piece,
            seen,
            solved: None,
            steps: 0,
            restored: 0,
            end: None,
            saved: Vec::new(),
            tried: TriedActions::default(),
        };
        let rng = draws.streams.stream("explore", job.number);
        let (ticks, left) = (0, job.patience);
        Self {
            level,
            job,
            visited,
            ticks,
            left,
            position: None,
            rng,
            last: None,
            next: None,
            redraw: None,
            was_solved: false,
            notes: TrialNotes::default(),
            has_news: false,
        }
    }

    /// Goes on from the snapshot of the path back, if there is one that the agent can load. Returns whether it did.
    pub fn restore(&mut self, game: &dyn Game, world: &mut World, agent: Entity) -> bool {
        let Some(saved) = self.job.saved.take().filter(|saved| saved.restore(game, world, agent)) else { return false };
        self.ticks = saved.tick();
        (self.visited.steps, self.visited.restored) = (self.ticks.into(), self.ticks);
        self.was_solved = world.get::<Episode>(agent).is_some_and(Episode::is_success);
        true
    }

    /// Looks at the cell of a snapshot at the end of the path back, as after a tick.
    ///
    /// # Errors
    ///
    /// The agent is in another cell than on the known path.
    pub fn look_around(
        &mut self,
        archive: &Archive,
        spot: impl FnOnce(u32, Option<Vec2>) -> Option<Spotted>,
    ) -> Result<(), Divergence> {
        match spot(self.ticks, None).filter(|_| self.ticks >= self.visited.destination.path.ticks) {
            Some(spotted) => self.look(spotted, None, archive),
            None => Ok(()),
        }
    }

    /// Sets the agent's next action, or lets the policy decide.
    pub fn act(&mut self, draws: &Draws, agent: &mut EntityWorldMut) {
        let path = self.job.route.len();
        if let Some(action) = self.job.route.actions.get(self.ticks as usize) {
            agent.insert(Action(action));
        } else if draws.is_policy {
            if self.ticks as usize == path && agent.get::<Control>() != Some(&Control::Policy) {
                let stream = |name| draws.streams.stream(name, self.job.number);
                let [level, action, skill] = ["explore/level", "explore/action", "explore/skill"].map(stream);
                let streams = AgentStreams::restored(level, action, skill);
                agent.insert((Control::Policy, streams, ActiveSkill::default(), AgentMemory::default()));
            }
        } else {
            // Drawn once, even if the level takes several ticks to load.
            let action = match self.next.take() {
                Some(action) => action,
                None => {
                    // The mask of the tick is not known yet.
                    self.redraw = agent.contains::<LegalActions>().then(|| below(&mut self.rng, 1 << 32) as u32);
                    self.draw(draws)
                }
            };
            agent.insert(Action(action.clone()));
            if let Some(random) = self.redraw {
                agent.insert(RedrawsIllegal { random });
            }
            self.next = Some(action);
        }
    }

    fn draw(&mut self, draws: &Draws) -> ActionValue {
        let is_kept = unit(&mut self.rng) < draws.sticky;
        match self.last.take().filter(|_| is_kept) {
            Some(action) => action,
            None => uniform(&draws.space, &mut self.rng),
        }
    }

    /// Updates the visit after a tick; true if the visit is over. `spot` returns the cell of the agent after this many
    /// ticks, and the cells that it has passed since a position. `save` returns a snapshot of this tick.
    ///
    /// # Errors
    ///
    /// The path back differs from the known one.
    pub fn note(
        &mut self,
        world: &World,
        agent: Entity,
        end: Option<EpisodeResult>,
        archive: &Archive,
        spot: impl FnOnce(u32, Option<Vec2>) -> Option<Spotted>,
        save: impl FnOnce() -> Option<SavedEpisode>,
    ) -> Result<bool, Divergence> {
        let episode = world.get::<Episode>(agent);
        let ticks = end.map_or_else(|| episode.map_or(0, |episode| episode.tick), |end| end.ticks);
        if ticks == self.ticks {
            // The level is still loading.
            return Ok(false);
        }
        self.ticks = ticks;
        self.visited.steps += 1;
        self.visited.end = end;
        let is_success = end.map_or_else(|| episode.is_some_and(Episode::is_success), |end| end.success);
        let hash = world.get::<StateHash>(agent).copied().unwrap_or_default().folded();
        let is_on_its_way = ticks as usize <= self.job.route.len();
        if is_on_its_way {
            self.check_way(hash, end)?;
            self.was_solved = is_success;
        } else {
            let action = world.get::<Action>(agent).cloned().unwrap_or_default().0;
            self.visited.piece.actions.push(&action).expect("actions are checked before they are played");
            self.visited.piece.hashes.push(hash);
            (self.last, self.next) = (Some(action), None);
            self.left = self.left.saturating_sub(1);
            if is_success && !self.was_solved && self.visited.solved.is_none() {
                self.visited.solved = Some(ticks);
            }
        }
        // After the end of an episode, the mask may be that of the next state.
        let mask = world.get::<LegalActions>(agent).filter(|_| !is_on_its_way && end.is_none());
        self.forbid(mask);
        if ticks >= self.visited.destination.path.ticks
            && let Some(spotted) = spot(ticks, self.position.take())
        {
            self.look(spotted, end, archive)?;
        }
        self.forbid(mask);
        if !is_on_its_way {
            self.note_end(end);
            self.save_news(end, save);
        }
        let explored = self.visited.piece.len();
        let is_spent = !is_on_its_way && (self.left == 0 || explored >= self.job.most as usize);
        Ok(end.is_some() || is_spent)
    }

    /// Notes illegal actions of this tick. They belong to the state before it.
    fn forbid(&mut self, mask: Option<&LegalActions>) {
        if let Some(mask) = mask {
            self.notes.forbid(self.ticks - 1, mask.mask());
        }
    }

    /// Notes the action that ended the game.
    fn note_end(&mut self, end: Option<EpisodeResult>) {
        if is_terminated(end)
            && let Some(trial) = self.trial(self.ticks, true)
        {
            self.notes.end(self.ticks, trial.action);
        }
    }

    /// Keeps a snapshot if a cell of this tick is news, and the last one is some ticks old. A game that saves nothing in
    /// this tick is asked again in the next one.
    fn save_news(&mut self, end: Option<EpisodeResult>, save: impl FnOnce() -> Option<SavedEpisode>) {
        let has_news = std::mem::take(&mut self.has_news) && end.is_none();
        let last = self.visited.saved.last().map(SavedEpisode::tick);
        if has_news && last.is_none_or(|last| self.ticks - last >= SPACING) {
            let saved = save();
            self.has_news = saved.is_none();
            self.visited.saved.extend(saved);
        }
    }

    /// Returns the discrete action that led to this many ticks, if it belongs to the visit and not to the path back.
    fn trial(&self, ticks: u32, is_over: bool) -> Option<Trial> {
        let index = ticks.checked_sub(1)?.checked_sub(self.visited.destination.path.ticks)? as usize;
        let ActionValue::Discrete(action) = self.visited.piece.actions.get(index)? else { return None };
        let hashes = &self.visited.piece.hashes;
        let before = index.checked_sub(1).map_or_else(|| self.job.route.hashes.last(), |before| hashes.get(before));
        Some(Trial { action, has_changed: hashes.get(index) != before, is_over })
    }

    /// Checks that this tick equals that of the known path.
    fn check_way(&self, hash: u32, end: Option<EpisodeResult>) -> Result<(), Divergence> {
        let tick = self.ticks - 1;
        let known = self.job.route.hashes[tick as usize];
        if hash != known {
            return Err(self.divergence(tick, format!("the state hash is {hash:08x}, and it was {known:08x} before")));
        }
        match end {
            Some(end) => {
                Err(self.divergence(tick, format!("the episode ended ({:?}), and it did not before", end.end)))
            }
            None => Ok(()),
        }
    }

    /// Adds the cell of the agent, and those that it has passed.
    fn look(&mut self, spotted: Spotted, end: Option<EpisodeResult>, archive: &Archive) -> Result<(), Divergence> {
        let Spotted { ticks, cell, position, passed } = spotted;
        let Destination { cell: wanted, path, is_passed } = &self.visited.destination;
        if ticks < path.ticks {
            return Ok(());
        }
        // After passing a cell the agent is in another one. The state hash has confirmed the path.
        let is_there = ticks == path.ticks && !is_passed;
        if let Some(wanted) = wanted.as_ref().filter(|wanted| is_there && **wanted != cell) {
            let what = format!("the agent is in cell {cell}, and the same actions led to cell {wanted} before");
            return Err(self.divergence(ticks.saturating_sub(1), what));
        }
        // An earlier sighting was not the end.
        let is_now = ticks == self.ticks;
        let is_over = end.is_some() && is_now;
        let trial = self.trial(ticks, is_now && is_terminated(end));
        self.notes.arrive(ticks, &cell, trial);
        for cell in passed {
            self.see(cell, Sight { ticks, is_over, is_passed: true }, archive);
        }
        self.see(cell, Sight { ticks, is_over, is_passed: false }, archive);
        self.position = position;
        Ok(())
    }

    /// Adds a cell, unless the visit has a better path to it.
    fn see(&mut self, cell: ExploredCell, sight: Sight, archive: &Archive) {
        if self.visited.seen.get(&cell).is_some_and(|known| !sight.is_better_than(known)) {
            return;
        }
        if archive.is_news(&cell, &sight) {
            self.left = self.job.patience;
            self.has_news = true;
        }
        self.visited.seen.insert(cell, sight);
    }

    fn divergence(&self, tick: u32, what: String) -> Divergence {
        Divergence { level: self.level, tick, what }
    }

    /// Returns whether the visit has played a tick beyond its path back.
    pub fn has_explored(&self) -> bool {
        !self.visited.piece.is_empty()
    }

    /// Returns the result, with the number of the visit.
    pub fn finish(self) -> (u64, Visited) {
        (self.job.number, Visited { tried: self.notes.tried, ..self.visited })
    }
}

/// Returns whether the game is over, and not only the time.
fn is_terminated(end: Option<EpisodeResult>) -> bool {
    end.is_some_and(|end| matches!(end.end, EpisodeEnd::Terminated { .. }))
}

#[cfg(test)]
mod tests {
    use playbot_learner::{Actions, Streams};

    use super::*;

    fn cell(number: i32) -> ExploredCell {
        ExploredCell(vec![number])
    }

    /// A visit from a cell of the archive, with the actions after it, and the cells by the tick in which they were
    /// seen.
    fn visit(archive: &Archive, from: Option<i32>, actions: &[u32], seen: &[(i32, u32, bool)]) -> Visited {
        let from = from.map(cell);
        let path = from.as_ref().map_or(KnownPath::START, |from| archive.cells[from].path);
        let seen =
            seen.iter().map(|&(number, ticks, is_over)| (cell(number), Sight { ticks, is_over, is_passed: false }));
        Visited {
            destination: Destination { cell: from, path, is_passed: false },
            piece: Route { actions: Actions::Discrete(actions.to_vec()), hashes: actions.to_vec() },
            seen: seen.collect(),
            solved: None,
            steps: u64::from(path.ticks) + actions.len() as u64,
            restored: 0,
            end: None,
            saved: Vec::new(),
            tried: TriedActions::default(),
        }
    }

    fn archive() -> Archive {
        let mut archive = Archive::new(ActionSpace::Discrete(10));
        archive.merge(visit(&archive, None, &[1, 2, 3], &[(1, 1, false), (2, 2, false), (3, 3, true)]));
        archive
    }

    fn actions(archive: &Archive, number: i32) -> Vec<u32> {
        archive.route_to(&cell(number)).expect("reached").hashes
    }

    #[test]
    fn a_shorter_way_takes_the_place_of_a_longer_one_and_others_keep_theirs() {
        let mut archive = archive();
        archive.merge(visit(&archive, Some(2), &[4, 5], &[(2, 2, false), (4, 4, false)]));
        assert_eq!(actions(&archive, 4), [1, 2, 4, 5]);
        archive.merge(visit(&archive, None, &[7, 8], &[(2, 1, false), (4, 2, false)]));
        assert_eq!((actions(&archive, 2), actions(&archive, 4)), (vec![7], vec![7, 8]));
        archive.merge(visit(&archive, None, &[6, 6, 6], &[(4, 3, false)]));
        assert_eq!(actions(&archive, 4), [7, 8], "a longer one is forgotten");
        assert_eq!(archive.cells[&cell(4)].visits, 3);
        assert_eq!(archive.start.visits, 3, "the visit from cell 2 is none of the start");
    }

    #[test]
    fn a_way_on_which_the_episode_goes_on_counts_more() {
        let mut archive = archive();
        assert!(archive.cells[&cell(3)].is_over);
        archive.merge(visit(&archive, Some(2), &[5, 5], &[(2, 2, false), (3, 4, false)]));
        assert_eq!(actions(&archive, 3), [1, 2, 5, 5]);
        archive.merge(visit(&archive, None, &[9], &[(3, 1, true)]));
        assert_eq!(actions(&archive, 3).len(), 4);
    }

    #[test]
    fn a_way_that_ends_in_a_cell_counts_more_than_one_that_passes_it() {
        let mut archive = archive();
        let passing = |archive: &Archive, actions: &[u32]| {
            let mut visit = visit(archive, None, actions, &[]);
            let ticks = actions.len() as u32;
            visit.seen.insert(cell(7), Sight { ticks, is_over: false, is_passed: true });
            visit
        };
        archive.merge(passing(&archive, &[4, 4]));
        assert_eq!((actions(&archive, 7), archive.cells[&cell(7)].is_passed), (vec![4, 4], true));
        assert!(archive.choose(99, &mut Streams::new(1).stream("test", 0)).iter().any(|chosen| chosen.is_passed));
        archive.merge(visit(&archive, None, &[5, 5, 5], &[(7, 3, false)]));
        assert_eq!((actions(&archive, 7), archive.cells[&cell(7)].is_passed), (vec![5, 5, 5], false));
        archive.merge(passing(&archive, &[6]));
        assert_eq!(actions(&archive, 7), [5, 5, 5]);
        assert_eq!(archive.cells[&cell(7)].visits, 3);
    }

    #[test]
    fn the_shortest_solution_is_kept() {
        let mut archive = archive();
        let solved = |archive: &Archive, actions: &[u32], ticks| Visited {
            solved: Some(ticks),
            ..visit(archive, None, actions, &[(1, 1, false)])
        };
        archive.merge(solved(&archive, &[4, 4, 4, 4], 3));
        assert_eq!(archive.solution().map(|path| archive.route(path).hashes), Some(vec![4, 4, 4]));
        archive.merge(solved(&archive, &[5, 5, 5, 5], 4));
        archive.merge(solved(&archive, &[6, 6], 2));
        assert_eq!(archive.solution().map(|path| archive.route(path).hashes), Some(vec![6, 6]));
    }

    #[test]
    fn a_visit_that_goes_another_way_differs_in_its_first_other_tick() {
        let archive = archive();
        let seen = [(2, 2, false), (4, 4, false)];
        let restored = visit(&archive, Some(2), &[4, 5], &seen);
        let same = Visited { restored: 2, ..visit(&archive, Some(2), &[4, 5], &seen) };
        assert_eq!(restored.first_difference(&same), None);
        assert_eq!(restored.first_difference(&visit(&archive, Some(2), &[4, 6], &seen)), Some(3));
        assert_eq!(restored.first_difference(&visit(&archive, Some(2), &[4, 5], &seen[..1])), Some(4));
    }

    #[test]
    fn cells_that_were_seen_less_are_chosen_more_and_those_where_it_is_over_never() {
        let mut archive = archive();
        for _ in 0..98 {
            archive.merge(visit(&archive, None, &[1], &[(1, 1, false)]));
        }
        let chosen = archive.choose(20_000, &mut Streams::new(1).stream("test", 0));
        let share = |cell: Option<ExploredCell>| {
            chosen.iter().filter(|destination| destination.cell == cell).count() as f64 / chosen.len() as f64
        };
        // Weights: the start and cell 1 have 99 visits, 1/10 each; cell 2 has one, 1/√2.
        let sum = 0.2 + 0.5_f64.sqrt();
        assert!((share(None) - 0.1 / sum).abs() < 0.01, "{}", share(None));
        assert!((share(Some(cell(1))) - 0.1 / sum).abs() < 0.01);
        assert!((share(Some(cell(2))) - 0.5_f64.sqrt() / sum).abs() < 0.01);
        assert_eq!(share(Some(cell(3))), 0.0);
        assert_eq!(archive.choose(9, &mut Streams::new(1).stream("test", 0)), chosen[..9]);
    }
}
