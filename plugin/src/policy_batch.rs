//! Decisions of the policy in a tick, for all agents of a World in one pass.

#[cfg(test)]
mod shared_batch_tests;

use crate::{
    agent::Agent,
    legal::LegalActions,
    observation::{Observation, start_batch},
    skill_prior::ActiveSkill,
};
use bevy::prelude::*;
use playbot_learner::{LearnError, ObsKind, Observations, Policy, PolicyOutput};
use std::sync::{
    Arc, Condvar, Mutex, MutexGuard, PoisonError,
    mpsc::{Receiver, Sender, channel},
};

/// The states for which the policy has decided in this tick, and their agents.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug, Default)]
pub struct PolicyBatch {
    agents: Vec<Entity>,
    rows: PolicyRows,
}

impl PolicyBatch {
    /// Returns the observations, in the order of the agents.
    pub fn observations(&self) -> &Observations {
        &self.rows.observations
    }

    /// Returns the remaining shares of their skills; empty without skills.
    pub fn left(&self) -> &[f32] {
        &self.rows.left
    }

    /// Returns what the policy remembered before, one agent after the other; empty for a policy without memory.
    pub fn memory(&self) -> &[f32] {
        &self.rows.memory
    }

    /// Returns the masks of their actions, one after the other; empty if no agent has one.
    pub fn legal(&self) -> &[bool] {
        &self.rows.legal
    }

    /// Returns the agents.
    pub(crate) fn agents(&self) -> &[Entity] {
        &self.agents
    }

    pub(crate) fn start(&mut self, kind: &ObsKind) {
        let PolicyRows { observations, skills, left, memory, legal, count } = &mut self.rows;
        start_batch(observations, kind);
        skills.clear();
        left.clear();
        memory.clear();
        legal.clear();
        *count = 0;
        self.agents.clear();
    }

    /// Adds an agent with its observation, its mask, and its skill, which is drawn anew every `skill_interval` ticks.
    pub(crate) fn push(
        &mut self,
        (entity, agent): (Entity, &Agent),
        observation: &Observation,
        legal: Option<&LegalActions>,
        skill: &ActiveSkill,
        skill_interval: Option<u32>,
    ) {
        self.agents.push(entity);
        observation.push_to(&mut self.rows.observations);
        self.rows.skills.extend_from_slice(&skill.z);
        self.rows.left.extend(skill_interval.map(|skill_interval| skill.left(skill_interval)));
        let mask: Vec<bool> = legal.into_iter().flat_map(|legal| legal.entries(&agent.actions)).collect();
        self.rows.push_legal(&mask, 1);
        self.rows.count += 1;
    }

    /// Adds what the newest agent remembers to a policy with a memory of this width. A memory of another policy does not
    /// count: the agent begins anew.
    pub(crate) fn push_memory(&mut self, memory: &[f32], width: usize) {
        let all = &mut self.rows.memory;
        let end = all.len() + width;
        all.extend_from_slice(if memory.len() == width { memory } else { &[] });
        all.resize(end, 0.0);
    }

    /// Decides in one pass, together with other Worlds if there are any.
    pub(crate) fn decide(&mut self, policy: &Policy, shared: Option<&SharedBatch>) -> Result<PolicyOutput, String> {
        match shared {
            Some(shared) => shared.decide(&mut self.rows),
            None => self.rows.decide(policy).map_err(|error| error.to_string()),
        }
    }
}

/// The states for which a policy decides in one pass.
#[derive(Clone, Debug)]
pub struct PolicyRows {
    /// `count` observations.
    pub observations: Observations,
    /// `count` skills, one after the other; empty without skills.
    pub skills: Vec<f32>,
    /// The remaining share of each skill's ticks, this one included; empty without skills.
    pub left: Vec<f32>,
    /// `count` memories, one after the other; empty for a policy without memory.
    pub memory: Vec<f32>,
    /// True for each legal action of each state, one after the other; empty if all are legal.
    pub legal: Vec<bool>,
    /// Number of states.
    pub count: usize,
}

impl Default for PolicyRows {
    fn default() -> Self {
        let observations = Observations::Vector(Vec::new());
        let (skills, left, memory) = (Vec::new(), Vec::new(), Vec::new());
        Self { observations, skills, left, memory, legal: Vec::new(), count: 0 }
    }
}

impl PolicyRows {
    /// Returns the policy's output for the states. Illegal actions have probability 0.
    ///
    /// # Errors
    ///
    /// As [`Policy::forward_remembering`].
    pub fn decide(&self, policy: &Policy) -> Result<PolicyOutput, LearnError> {
        let mut output =
            policy.forward_remembering(&self.skills, &self.left, &self.memory, &self.observations, self.count)?;
        output.restrict(&self.legal);
        Ok(output)
    }

    /// Adds the masks of `count` further states, or none. In states without a mask, beside others, all actions are
    /// legal.
    fn push_legal(&mut self, more: &[bool], count: usize) {
        if self.legal.is_empty() && more.is_empty() {
            return;
        }
        let width = more.len().checked_div(count).filter(|&width| width > 0);
        let actions = width.or(self.legal.len().checked_div(self.count)).unwrap_or_default();
        self.legal.resize(self.count * actions, true);
        self.legal.extend_from_slice(more);
        self.legal.resize((self.count + count) * actions, true);
    }

    pub(crate) fn append(&mut self, more: &Self) -> Result<(), LearnError> {
        self.observations.push(&more.observations)?;
        self.skills.extend_from_slice(&more.skills);
        self.left.extend_from_slice(&more.left);
        self.memory.extend_from_slice(&more.memory);
        self.push_legal(&more.legal, more.count);
        self.count += more.count;
        Ok(())
    }
}

// Shared forward passes.

/// A World's seat among those that share passes.
///
/// A pass over a few rows takes a GPU as long as one over thousands. Worlds of a single agent spend more time on the
/// pass than on computing. So each World gets a thread and a seat. It submits its rows and waits; the last World of a
/// group computes for the whole group, on its own thread. Other groups simulate or compute meanwhile. There are two for
/// a graphics card, and two for each thread on CPUs.
///
/// The result of a row does not depend on the other rows, so the games run as they do alone.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug)]
pub struct SharedBatch {
    table: Arc<Table>,
    seat: usize,
}

/// Number of groups for a graphics card, and for each thread on CPUs. With two groups seats of even number make one,
/// those of odd number the other.
const GROUPS: usize = 2;

impl SharedBatch {
    /// Creates seats for as many Worlds, of which at most `threads` simulate at a time. Each World
    /// runs on its own thread.
    pub fn seats(policy: &Policy, worlds: usize, threads: usize) -> Vec<Self> {
        let groups = GROUPS * if policy.is_on_host() { threads.clamp(1, worlds.max(1)) } else { 1 };
        let group = |first| Mutex::new(Group { worlds: (first..worlds).step_by(groups).count(), waiting: Vec::new() });
        let table = Arc::new(Table {
            policy: policy.clone(),
            groups: (0..groups).map(group).collect(),
            free: Mutex::new(threads.max(1)),
            freed: Condvar::new(),
        });
        (0..worlds).map(|seat| Self { table: table.clone(), seat }).collect()
    }

    /// Waits until this World may simulate. When the guard is dropped the World leaves, and the
    /// others no longer wait for it.
    pub fn play(&self) -> Playing<'_> {
        self.table.begin();
        Playing(self)
    }

    /// Returns the policy's output for the rows, which all Worlds of a group submit at the same
    /// time. Call it on the thread that has [begun to play](Self::play).
    ///
    /// # Errors
    ///
    /// The reason why the pass failed, as text.
    pub(crate) fn decide(&self, rows: &mut PolicyRows) -> Result<PolicyOutput, String> {
        let (answer, answered) = channel();
        let mine = Waiting { seat: self.seat, rows: std::mem::take(rows), answer };
        self.change(|group| group.waiting.push(mine));
        self.table.end();
        let output = self.receive(&answered, rows);
        self.table.begin();
        output
    }

    fn receive(&self, answered: &Receiver<Answer>, rows: &mut PolicyRows) -> Result<PolicyOutput, String> {
        let (mine, output) = answered.recv().map_err(|_| "the World that computed for all has stopped".to_owned())?;
        *rows = mine;
        output
    }

    /// Changes the group. If all of its Worlds wait then, this thread computes for them.
    fn change(&self, change: impl FnOnce(&mut Group)) {
        let groups = &self.table.groups;
        let mut group = lock(&groups[self.seat % groups.len()]);
        change(&mut group);
        if group.waiting.len() == group.worlds && group.worlds > 0 {
            let waiting = std::mem::take(&mut group.waiting);
            drop(group);
            compute(&self.table.policy, waiting);
        }
    }
}

/// A World that simulates, or waits for its turn.
#[must_use]
#[derive(Debug)]
pub struct Playing<'a>(&'a SharedBatch);

impl Drop for Playing<'_> {
    fn drop(&mut self) {
        self.0.change(|group| group.worlds -= 1);
        self.0.table.end();
    }
}

#[derive(Debug)]
struct Table {
    policy: Policy,
    groups: Vec<Mutex<Group>>,
    /// Number of further Worlds that may simulate. More would compete for the cores.
    free: Mutex<usize>,
    freed: Condvar,
}

impl Table {
    fn begin(&self) {
        let free = lock(&self.free);
        let mut free = self.freed.wait_while(free, |free| *free == 0).unwrap_or_else(PoisonError::into_inner);
        *free -= 1;
    }

    fn end(&self) {
        *lock(&self.free) += 1;
        self.freed.notify_one();
    }
}

#[derive(Debug, Default)]
struct Group {
    /// Worlds that have not left.
    worlds: usize,
    waiting: Vec<Waiting>,
}

/// A World that has submitted its rows.
#[derive(Debug)]
struct Waiting {
    seat: usize,
    rows: PolicyRows,
    answer: Sender<Answer>,
}

/// A World's own rows, and the policy's output for them.
type Answer = (PolicyRows, Result<PolicyOutput, String>);

/// Locks a mutex. A World that panicked leaves the locked data as it was.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Computes for all waiting Worlds, and wakes them.
fn compute(policy: &Policy, mut waiting: Vec<Waiting>) {
    // The result must not depend on the order in which they came.
    waiting.sort_by_key(|world| world.seat);
    let outputs = outputs(policy, &waiting).map_err(|error| error.to_string());
    let mut outputs = outputs.map(Vec::into_iter);
    for Waiting { rows, answer, .. } in waiting {
        let output = match &mut outputs {
            Ok(outputs) => outputs.next().ok_or_else(|| "the policy has left out some".to_owned()),
            Err(error) => Err(error.clone()),
        };
        // The receiver is gone if that World has panicked.
        drop(answer.send((rows, output)));
    }
}

fn outputs(policy: &Policy, waiting: &[Waiting]) -> Result<Vec<PolicyOutput>, LearnError> {
    if let [alone] = waiting {
        return Ok(vec![alone.rows.decide(policy)?]);
    }
    let mut all = PolicyRows { observations: Observations::empty(&policy.observation()), ..PolicyRows::default() };
    waiting.iter().try_for_each(|world| all.append(&world.rows))?;
    let sizes: Vec<usize> = waiting.iter().map(|world| world.rows.count).collect();
    Ok(all.decide(policy)?.split(&sizes))
}
