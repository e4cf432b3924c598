//! The visit of an agent: its path back to a cell, and the exploration from there.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionSpace, ActionValue},
    bot::uniform,
    control::Control,
    demo::replay::Divergence,
    episode::{Episode, EpisodeResult},
    level::LevelQueue,
    skill_prior::ActiveSkill,
    state_hash::StateHash,
    streams::AgentStreams,
};
use playbot_learner::{
    Streams,
    rng::{ChaCha8Rng, unit},
};

use super::{
    archive::{Archive, Destination},
    cell::Cell,
    job::Job,
    lookout::Spotted,
    ways::Route,
};

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
    pub seen: BTreeMap<Cell, Sight>,
    /// Ticks after which the level's goal was reached.
    pub solved: Option<u32>,
    /// Ticks played, with the path back.
    pub steps: u64,
    /// The result of the episode, if it ended.
    pub end: Option<EpisodeResult>,
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
    place: Option<Vec2>,
    rng: ChaCha8Rng,
    /// The last random action that was played.
    last: Option<ActionValue>,
    /// The next action.
    next: Option<ActionValue>,
    /// Whether the goal was reached on the path back.
    was_solved: bool,
}

impl Visit {
    /// Starts the level for an agent. Its current episode is dropped.
    pub fn begin(job: Job, level: u64, draws: &Draws, agent: &mut EntityWorldMut) -> Self {
        if let Some(mut running) = agent.get_mut::<Episode>() {
            running.abandon();
        }
        // The streams of replays, for games that draw from the streams of their agents.
        agent.insert((Control::Bot, LevelQueue::Always(level), AgentStreams::new(0, 0)));
        let destination = job.destination.clone();
        let sight = Sight { ticks: destination.way.ticks, is_over: false, is_passed: destination.is_passed };
        let here = destination.cell.clone().map(|cell| (cell, sight));
        let piece = Route::empty(&draws.space);
        let seen = here.into_iter().collect();
        let visited = Visited { destination, piece, seen, solved: None, steps: 0, end: None };
        let rng = draws.streams.stream("explore", job.number);
        let (ticks, left) = (0, job.patience);
        Self { level, job, visited, ticks, left, place: None, rng, last: None, next: None, was_solved: false }
    }

    /// Sets the agent's next action, or lets the policy decide.
    pub fn act(&mut self, draws: &Draws, agent: &mut EntityWorldMut) {
        let way = self.job.route.len();
        if let Some(action) = self.job.route.actions.get(self.ticks as usize) {
            agent.insert(Action(action));
        } else if draws.is_policy {
            if self.ticks as usize == way && agent.get::<Control>() != Some(&Control::Policy) {
                let stream = |name| draws.streams.stream(name, self.job.number);
                let [level, action, skill] = ["explore/level", "explore/action", "explore/skill"].map(stream);
                agent.insert((Control::Policy, AgentStreams::restored(level, action, skill), ActiveSkill::default()));
            }
        } else {
            // Drawn once, even if the level takes several ticks to load.
            let action = match self.next.take() {
                Some(action) => action,
                None => self.draw(draws),
            };
            agent.insert(Action(action.clone()));
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
    /// ticks, and the cells that it has passed since a position.
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
        if ticks >= self.visited.destination.way.ticks
            && let Some(spotted) = spot(ticks, self.place.take())
        {
            self.look(spotted, end.is_some(), archive)?;
        }
        let explored = self.visited.piece.len();
        let is_spent = !is_on_its_way && (self.left == 0 || explored >= self.job.most as usize);
        Ok(end.is_some() || is_spent)
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
    fn look(&mut self, spotted: Spotted, is_last: bool, archive: &Archive) -> Result<(), Divergence> {
        let Spotted { ticks, cell, place, passed } = spotted;
        let Destination { cell: wanted, way, is_passed } = &self.visited.destination;
        if ticks < way.ticks {
            return Ok(());
        }
        // After passing a cell the agent is in another one. The state hash has confirmed the path.
        let is_there = ticks == way.ticks && !is_passed;
        if let Some(wanted) = wanted.as_ref().filter(|wanted| is_there && **wanted != cell) {
            let what = format!("the agent is in cell {cell}, and the same actions led to cell {wanted} before");
            return Err(self.divergence(ticks.saturating_sub(1), what));
        }
        // An earlier sighting was not the end.
        let is_over = is_last && ticks == self.ticks;
        for cell in passed {
            self.see(cell, Sight { ticks, is_over, is_passed: true }, archive);
        }
        self.see(cell, Sight { ticks, is_over, is_passed: false }, archive);
        self.place = place;
        Ok(())
    }

    /// Adds a cell, unless the visit has a better path to it.
    fn see(&mut self, cell: Cell, sight: Sight, archive: &Archive) {
        if self.visited.seen.get(&cell).is_some_and(|known| !sight.is_better_than(known)) {
            return;
        }
        if archive.is_news(&cell, &sight) {
            self.left = self.job.patience;
        }
        self.visited.seen.insert(cell, sight);
    }

    fn divergence(&self, tick: u32, what: String) -> Divergence {
        Divergence { level: self.level, tick, what }
    }

    /// Returns the result, with the number of the visit.
    pub fn finish(self) -> (u64, Visited) {
        (self.job.number, self.visited)
    }
}
