//! Collection of rollouts: a World that plays with the current policy.

use crate::rival_seats::{ArenaRivals, RivalSeats};
use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionSpace, ActionValue},
    agent::{Agent, AgentOrder, Control},
    demo::recorder,
    engine::{
        PlaysAlong, PolicyBatch, Renewal, SharedBatch, TickSchedules, draw_skills, run_observe_schedule, tick_world,
    },
    episode::{Episode, EpisodeEnd, EpisodeEnded},
    fault::{Fault, Faults},
    legal::LegalActions,
    level::LevelQueue,
    observation::Observation,
    policy::{ActionDraw, ActivePolicy, AgentMemory, Decision},
    reward::Reward,
    skill_prior::{ActiveSkill, SkillMemory, SkillPrior},
    state_hash::StateHash,
    streams::AgentStreams,
    systems::PlaybotSystems,
    vision::{ObservationConfig, VisionError},
};
use playbot_harness::{
    eval::Player,
    game::Game,
    rivals::matches::MatchEnds,
    sensors::GameSensors,
    split::LevelSplit,
    worlds::{build_observing_world, other_agents},
};
use playbot_learner::{
    Actions, LearnError, ObsColumns, ObsKind, Observations, Policy, RngState, Rollout, RolloutStep, rng::normal,
};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A World of arenas that fills rollouts.
pub struct Collector {
    world: World,
    agents: Vec<Entity>,
    /// Number of the first agent.
    first: u32,
    /// The players of the other agents, if they are chosen for each episode.
    rivals: Option<RivalSeats>,
}

/// Rows of the rollout under construction.
#[derive(Resource, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
struct Collecting {
    #[reflect(ignore)]
    rollout: Rollout,
    #[reflect(ignore)]
    kind: ObsKind,
}

/// An episode that ended during a rollout.
#[derive(Clone, Copy, Debug)]
pub struct Ended {
    /// The tick of the rollout, from 0 on.
    pub tick: usize,
    /// Its agent, as a column of the rollout.
    pub agent: usize,
    /// The episode.
    pub episode: EpisodeEnded,
}

/// Episodes that ended in the last tick, in the order of the agents.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
struct Finished(Vec<EpisodeEnded>);

fn note_finished(event: On<EpisodeEnded>, others: Query<(), With<PlaysAlong>>, mut finished: ResMut<Finished>) {
    if !others.contains(event.entity) {
        finished.0.push(*event);
    }
}

/// Actions of the current episode.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub(crate) struct ActionLog(pub(crate) Vec<ActionValue>);

impl ActionLog {
    /// Notes the action of this tick; the log is emptied after the last tick of an episode.
    fn note(&mut self, episode: &Episode, action: &ActionValue) {
        if episode.tick <= 1 || episode.end().is_some() {
            self.0.clear();
        }
        if episode.end().is_none() {
            self.0.push(action.clone());
        }
    }
}

impl Collector {
    /// Makes a collector of agents `first..first + count` on the levels of a split, with skills if there is a prior.
    ///
    /// # Errors
    ///
    /// The game does not support the observations.
    pub fn new(
        game: &dyn Game,
        split: &LevelSplit,
        observation_config: &ObservationConfig,
        seed: u64,
        first: u32,
        count: u32,
        prior: Option<SkillPrior>,
    ) -> Result<Self, VisionError> {
        let (mut world, agents) = build_observing_world(game, &split.mode, observation_config, seed, first, count)?;
        let kind = observation_config.obs_kind(game);
        Renewal::set_up(&mut world, |world| {
            world.init_resource::<Finished>();
            world.add_observer(note_finished);
            let judge = world.resource::<TickSchedules>().judge;
            world.schedule_scope(judge, |_, schedule| {
                schedule.add_systems(collect_tick.in_set(PlaybotSystems::Record).after(recorder::record_ticks));
            });
        });
        Renewal::carry_resource::<Finished>(&mut world);
        Renewal::carry_resource::<Collecting>(&mut world);
        Renewal::carry_resource::<SharedBatch>(&mut world);
        Renewal::carry_component::<ActionLog>(&mut world);
        world.insert_resource(Collecting { rollout: Rollout::new(0, kind, 0, &game.actions()), kind });
        if let Some(prior) = prior {
            world.insert_resource(prior);
        }
        for (&agent, index) in agents.iter().zip(first..) {
            world.entity_mut(agent).insert((
                AgentStreams::new(seed, index),
                Control::Policy,
                LevelQueue::Uniform { first: split.first, last: split.last },
                ActionLog::default(),
            ));
        }
        Ok(Self { world, agents, first, rivals: None })
    }

    /// Plays `steps` ticks with this policy; `latent` is the width of the skills to keep, 0 for no skills.
    ///
    /// Returns the rollout, `[steps, agents]`, and the episodes that ended in it.
    ///
    /// # Errors
    ///
    /// The game's first breach of contract, with agent, level and tick.
    pub fn collect(&mut self, policy: &Policy, latent: usize, steps: usize) -> Result<(Rollout, Vec<Ended>), Fault> {
        let kind = self.world.resource::<Collecting>().kind;
        let mut obs = Observations::empty(&kind);
        // One share has one column.
        let mut columns = obs.columns(&kind, steps, &[self.agents.len()]).remove(0);
        let (rollout, ended) = self.collect_into(&mut columns, policy, latent, steps)?;
        Ok((Rollout { obs, ..rollout }, ended))
    }

    /// Collects as [`collect_into`](Self::collect_into) does, and decides together with the Worlds on the other
    /// seats, each of which runs on its own thread.
    ///
    /// # Errors
    ///
    /// As for [`collect`](Self::collect).
    pub fn collect_at(
        &mut self,
        seat: &SharedBatch,
        columns: &mut ObsColumns<'_>,
        policy: &Policy,
        latent: usize,
        steps: usize,
    ) -> Result<(Rollout, Vec<Ended>), Fault> {
        let _playing = seat.play();
        self.world.insert_resource(seat.clone());
        let collected = self.collect_into(columns, policy, latent, steps);
        self.world.remove_resource::<SharedBatch>();
        collected
    }

    /// Collects as [`collect`](Self::collect) does, with the observations in these columns instead of the rollout.
    /// The policy decides for them.
    ///
    /// # Errors
    ///
    /// As for [`collect`](Self::collect).
    pub fn collect_into(
        &mut self,
        columns: &mut ObsColumns<'_>,
        policy: &Policy,
        latent: usize,
        steps: usize,
    ) -> Result<(Rollout, Vec<Ended>), Fault> {
        let world = &mut self.world;
        world.insert_resource(ActivePolicy { policy: policy.clone(), draw: ActionDraw::Sample });
        let kind = world.resource::<Collecting>().kind;
        let empty = Rollout::new(self.agents.len(), kind, latent, &policy.action_space());
        world.resource_mut::<Collecting>().rollout = empty.clone();
        let mut ended = Vec::new();
        for tick in 0..steps {
            if let Some(rivals) = &mut self.rivals {
                rivals.before_tick(world, self.agents[0]);
            }
            let ticked = tick_world(world);
            // What follows from a panic, or from another number of agents, says less.
            let is_panic = ticked.as_ref().is_err_and(|fault| fault.0.contains("panicked: "));
            if let Some(why) = other_agents(world, &self.agents, self.first).filter(|_| !is_panic) {
                return Err(Fault(why));
            }
            ticked?;
            if let Some(rivals) = &mut self.rivals {
                rivals.after_tick(world, self.agents[0]);
            }
            let finished = std::mem::take(&mut world.resource_mut::<Finished>().0);
            let column = |agent: Entity| self.agents.iter().position(|own| *own == agent).unwrap_or_default();
            ended.extend(finished.into_iter().map(|episode| Ended { tick, agent: column(episode.entity), episode }));
            let seen = world.resource::<PolicyBatch>().observations();
            columns.fill_next(seen.as_slice()).map_err(|error| Fault(error.to_string()))?;
        }
        let mut rollout = std::mem::replace(&mut world.resource_mut::<Collecting>().rollout, empty);
        bootstrap_values(world, policy, &mut rollout).map_err(|error| Fault(error.to_string()))?;
        world.resource_mut::<Faults>().take()?;
        Ok((rollout, ended))
    }

    /// Chooses the players of the other agents of its World, in which one agent learns, for each episode.
    pub(crate) fn set_rivals(&mut self, rivals: RivalSeats) {
        MatchEnds::note_in(&mut self.world);
        self.rivals = Some(rivals);
    }

    /// Returns the players of the other agents, if they are chosen for each episode.
    pub(crate) fn rivals_mut(&mut self) -> Option<&mut RivalSeats> {
        self.rivals.as_mut()
    }

    /// Seats the rivals of a saved episode.
    pub(crate) fn restore_rivals(
        &mut self,
        state: ArenaRivals,
        find: impl Fn(usize) -> Option<Player>,
    ) -> Result<(), RestoreError> {
        let Some(rivals) = &mut self.rivals else { return Ok(()) };
        rivals.restore(&mut self.world, state, find).map_err(RestoreError::Rival)
    }

    pub(crate) fn world(&self) -> &World {
        &self.world
    }

    /// Returns the World, for saving and restoring its arenas.
    pub(crate) fn world_mut(&mut self) -> &mut World {
        &mut self.world
    }

    /// Returns the agents, in the order of their numbers.
    pub fn agents(&self) -> &[Entity] {
        &self.agents
    }

    /// Gives each agent the queue of its next levels. Episodes that run go on.
    pub(crate) fn set_queues(&mut self, queues: &[LevelQueue]) {
        for (&agent, queue) in self.agents.iter().zip(queues) {
            self.world.entity_mut(agent).insert(queue.clone());
        }
    }

    /// Returns the random streams of its agents.
    pub(crate) fn streams(&self) -> Vec<AgentStreams> {
        self.agents.iter().filter_map(|&agent| self.world.get::<AgentStreams>(agent).cloned()).collect()
    }

    /// Gives its agents the random streams of others.
    pub(crate) fn set_streams(&mut self, streams: &[AgentStreams]) {
        for (&agent, streams) in self.agents.iter().zip(streams) {
            self.world.entity_mut(agent).insert(streams.clone());
        }
    }
}

/// Adds the states in which the rollout stopped, with the skills active there, and their values.
///
/// Agents between two episodes have no such state. Their row is 0 and is never used, since their last row ended an
/// episode.
fn bootstrap_values(world: &mut World, policy: &Policy, rollout: &mut Rollout) -> Result<(), LearnError> {
    run_observe_schedule(world);
    if world.contains_resource::<SkillPrior>()
        && let Err(error) = world.run_system_cached(draw_skills)
    {
        world.resource_mut::<Faults>().report(error.to_string());
    }
    let entities = agents_of_order(world);
    let running: Vec<_> = (0..entities.len())
        .filter(|&row| world.get::<Episode>(entities[row]).is_some_and(Episode::is_running))
        .collect();
    let kind = rollout.obs_kind;
    let (mut skills, mut left, mut observations) = (Vec::new(), Vec::new(), Observations::empty(&kind));
    let (width, mut memory) = (memory_width(world, policy), Vec::new());
    for &row in &running {
        push_state(world, entities[row], &mut skills, &mut left, &mut observations);
        push_memory(world, entities[row], policy, &mut memory);
    }
    // A policy without memory ignores that of a policy over skills.
    let values = policy.values_remembering(&skills, &left, &memory, &observations, running.len())?;
    let latent = rollout.latent;
    rollout.next_values = vec![0.0; entities.len()];
    rollout.ends.next_obs = Observations::zeros(&kind, entities.len());
    rollout.ends.next_z = vec![0.0; entities.len() * latent];
    // A prior may exist without running agents.
    let counted = if world.contains_resource::<SkillPrior>() { entities.len() } else { 0 };
    rollout.ends.next_left = vec![1.0; counted];
    rollout.ends.next_memory = vec![0.0; entities.len() * width];
    for (i, (&row, value)) in running.iter().zip(values).enumerate() {
        rollout.next_values[row] = value;
        if let Some(&left) = left.get(i) {
            rollout.ends.next_left[row] = left;
        }
        rollout.ends.next_memory[row * width..(row + 1) * width].copy_from_slice(&memory[i * width..(i + 1) * width]);
        rollout.ends.next_obs.set_row(row, observations.row(i, kind.numbers()))?;
        rollout.ends.next_z[row * latent..(row + 1) * latent].copy_from_slice(&skills[i * latent..(i + 1) * latent]);
    }
    // Masks of agents between two episodes are not used, either.
    rollout.ends.next_legal = masks(world, entities.iter().copied());
    Ok(())
}

/// Returns the agents whose ticks are rows of the rollout, in order: all but those that play along.
fn agents_of_order(world: &World) -> Vec<Entity> {
    let order = world.resource::<AgentOrder>().entities().iter();
    order.copied().filter(|&agent| world.get::<PlaysAlong>(agent).is_none()).collect()
}

/// Appends one row per agent to the rollout.
fn collect_tick(world: &mut World) {
    let Some(policy) = world.get_resource::<ActivePolicy>().map(|active| active.policy.clone()) else {
        // Arenas are being restored, not played.
        return;
    };
    // The rollout is put back even if the tick fails.
    let pushed = world.try_resource_scope(|world, mut collecting: Mut<Collecting>| {
        let entities = agents_of_order(world);
        let kind = collecting.kind;
        let cut = cut_episodes(world, &entities, &policy, &kind)?;
        let mut final_values = vec![0.0; entities.len()];
        for (&row, &value) in cut.agents.iter().zip(&cut.values) {
            final_values[row] = value;
        }
        let tick = tick_of(world, &entities, AgentsTick::new(&policy, &kind))?;
        collecting.rollout.push_left(world.resource::<PolicyBatch>().left());
        match policy.memory() {
            0 => push_skill_memories(world, &entities, &mut collecting.rollout),
            _ => collecting.rollout.push_memory(world.resource::<PolicyBatch>().memory()),
        }
        push_tick(&mut collecting.rollout, &tick, &final_values, &cut)?;
        collecting.rollout.push_legal(world.resource::<PolicyBatch>().legal());
        Ok::<(), LearnError>(())
    });
    if let Some(Err(error)) = pushed {
        world.resource_mut::<Faults>().report(error.to_string());
    }
}

/// Adds the actions and results of each agent to `tick`.
fn tick_of(world: &mut World, entities: &[Entity], mut tick: AgentsTick) -> Result<AgentsTick, LearnError> {
    let mut query =
        world.query_filtered::<(&ActiveSkill, &Action, &Decision, &Reward, &Episode, &mut ActionLog), With<Agent>>();
    for &entity in entities {
        let Ok((skill, action, decision, reward, episode, mut log)) = query.get_mut(world, entity) else {
            continue;
        };
        tick.z.extend_from_slice(&skill.z);
        tick.actions.push(&action.0)?;
        tick.log_probs.push(decision.log_prob);
        tick.values.push(decision.value);
        tick.rewards.push(reward.get());
        tick.terminated.push(matches!(episode.end(), Some(EpisodeEnd::Terminated { .. })));
        tick.truncated.push(episode.end() == Some(EpisodeEnd::Truncated));
        log.note(episode, &action.0);
    }
    Ok(tick)
}

fn push_tick(
    rollout: &mut Rollout,
    tick: &AgentsTick,
    final_values: &[f32],
    cut: &CutEpisodes,
) -> Result<(), LearnError> {
    rollout.push_step(tick.as_step(final_values))?;
    let (width, latent) = (rollout.obs_kind.numbers(), rollout.latent);
    for (i, &row) in cut.agents.iter().enumerate() {
        let z = cut.z.get(i * latent..(i + 1) * latent).unwrap_or_default();
        rollout.push_cut(row, cut.obs.row(i, width), z)?;
        rollout.ends.cut_left.extend(cut.left.get(i));
    }
    rollout.ends.cut_memory.extend_from_slice(&cut.memory);
    rollout.ends.cut_legal.extend_from_slice(&cut.legal);
    Ok(())
}

/// Actions and results of each agent in a tick; for the shapes see [`RolloutStep`]. Observations are kept elsewhere.
pub(crate) struct AgentsTick {
    no_obs: Observations,
    pub(crate) z: Vec<f32>,
    pub(crate) actions: Actions,
    pub(crate) log_probs: Vec<f32>,
    pub(crate) values: Vec<f32>,
    pub(crate) rewards: Vec<f32>,
    pub(crate) terminated: Vec<bool>,
    pub(crate) truncated: Vec<bool>,
}

impl AgentsTick {
    pub(crate) fn new(policy: &Policy, kind: &ObsKind) -> Self {
        let empty = Vec::new;
        Self {
            no_obs: Observations::empty(kind),
            z: empty(),
            actions: Actions::empty(&policy.action_space()),
            log_probs: empty(),
            values: empty(),
            rewards: empty(),
            terminated: Vec::new(),
            truncated: Vec::new(),
        }
    }

    pub(crate) fn as_step<'a>(&'a self, final_values: &'a [f32]) -> RolloutStep<'a> {
        RolloutStep {
            obs: self.no_obs.as_slice(),
            z: &self.z,
            actions: &self.actions,
            log_probs: &self.log_probs,
            values: &self.values,
            rewards: &self.rewards,
            terminated: &self.terminated,
            truncated: &self.truncated,
            final_values,
        }
    }
}

// Episodes that ran out of time.

/// The last states of the episodes that ran out of time in one tick.
pub(crate) struct CutEpisodes {
    pub(crate) agents: Vec<usize>,
    pub(crate) obs: Observations,
    pub(crate) z: Vec<f32>,
    /// Remaining ticks of these skills; empty without a prior.
    pub(crate) left: Vec<f32>,
    /// What the policy remembers of these episodes; empty without memory.
    pub(crate) memory: Vec<f32>,
    /// Masks of their actions; empty without any.
    pub(crate) legal: Vec<bool>,
    pub(crate) values: Vec<f32>,
}

impl CutEpisodes {
    pub(crate) fn new(agents: Vec<usize>, kind: &ObsKind) -> Self {
        let (z, left, memory, values) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { agents, obs: Observations::empty(kind), z, left, memory, legal: Vec::new(), values }
    }
}

/// Returns the last state of each episode that ran out of time in this tick, with its value.
///
/// The skill is the agent's present one. If it has just run out, the next one is drawn from a copy of the agent's
/// stream. The next draw of the stream itself belongs to the next episode.
pub(crate) fn cut_episodes(
    world: &mut World,
    entities: &[Entity],
    policy: &Policy,
    kind: &ObsKind,
) -> Result<CutEpisodes, LearnError> {
    let agents: Vec<_> = (0..entities.len())
        .filter(|&row| {
            world.get::<Episode>(entities[row]).is_some_and(|episode| episode.end() == Some(EpisodeEnd::Truncated))
        })
        .collect();
    let mut cut = CutEpisodes::new(agents, kind);
    if cut.agents.is_empty() {
        return Ok(cut);
    }
    let before: Vec<_> = entities.iter().map(|&entity| world.get::<Observation>(entity).cloned()).collect();
    run_observe_schedule(world);
    for (i, &row) in cut.agents.iter().enumerate() {
        let skill_from = cut.z.len();
        push_state(world, entities[row], &mut cut.z, &mut cut.left, &mut cut.obs);
        push_memory(world, entities[row], policy, &mut cut.memory);
        let held = world.get::<ActiveSkill>(entities[row]).is_some_and(|skill| skill.ticks_left > 0);
        let streams = world.get::<AgentStreams>(entities[row]);
        if let (false, Some(prior), Some(streams)) = (held, world.get_resource::<SkillPrior>(), streams) {
            let (last, mut stream) = (cut.obs.row(i, kind.numbers()), streams.skill.clone());
            let drawn = prior.prior.sample(last, 1, prior.draw, &mut |_| normal(&mut stream))?;
            cut.z.truncate(skill_from);
            cut.z.extend(drawn);
        }
    }
    cut.legal = masks(world, cut.agents.iter().map(|&row| entities[row]));
    cut.values = policy.values_remembering(&cut.z, &cut.left, &cut.memory, &cut.obs, cut.agents.len())?;
    // The current row belongs to the state before the action.
    for (&entity, before) in entities.iter().zip(before) {
        if let (Some(before), Some(mut observation)) = (before, world.get_mut::<Observation>(entity)) {
            *observation = before;
        }
    }
    Ok(cut)
}

/// Adds an agent's present observation, its skill, and the skill's remaining ticks.
pub(crate) fn push_state(
    world: &World,
    entity: Entity,
    skills: &mut Vec<f32>,
    left: &mut Vec<f32>,
    observations: &mut Observations,
) {
    if let (Some(skill), Some(observation)) = (world.get::<ActiveSkill>(entity), world.get::<Observation>(entity)) {
        skills.extend_from_slice(&skill.z);
        left.extend(world.get_resource::<SkillPrior>().map(|prior| skill.left(prior.skill_interval)));
        observation.push_to(observations);
    }
}

/// Returns how many numbers are remembered: by the policy, or by a policy over skills.
fn memory_width(world: &World, policy: &Policy) -> usize {
    let of_skills = world.get_resource::<SkillPrior>().map_or(0, |prior| prior.prior.memory());
    policy.memory().max(of_skills)
}

/// Adds what an agent's policy remembers of its present episode, or the policy over skills in its place: before a skill
/// that was just drawn, since its state is the one in which it was drawn.
fn push_memory(world: &World, entity: Entity, policy: &Policy, all: &mut Vec<f32>) {
    let width = memory_width(world, policy);
    let begun = world.get::<Episode>(entity).is_some_and(|episode| episode.tick > 0);
    let memory = match policy.memory() {
        0 => world.get::<SkillMemory>(entity).map(|memory| match is_just_drawn(world, entity) {
            true => &memory.before,
            false => &memory.now,
        }),
        _ => world.get::<AgentMemory>(entity).map(|memory| &memory.0),
    };
    let end = all.len() + width;
    all.extend_from_slice(memory.filter(|memory| begun && memory.len() == width).map_or(&[], |memory| memory));
    all.resize(end, 0.0);
}

fn is_just_drawn(world: &World, entity: Entity) -> bool {
    let interval = world.get_resource::<SkillPrior>().map(|prior| prior.skill_interval);
    interval == world.get::<ActiveSkill>(entity).map(|skill| skill.ticks_left)
}

/// Adds what the policy over skills remembered before the last draw of each agent, if it has a memory.
fn push_skill_memories(world: &World, entities: &[Entity], rollout: &mut Rollout) {
    let width = world.get_resource::<SkillPrior>().map_or(0, |prior| prior.prior.memory());
    if width == 0 {
        return;
    }
    let mut all = Vec::with_capacity(entities.len() * width);
    for (row, &entity) in entities.iter().enumerate() {
        let memory = world.get::<SkillMemory>(entity).filter(|memory| memory.before.len() == width);
        all.extend_from_slice(memory.map_or(&[], |memory| &memory.before));
        all.resize((row + 1) * width, 0.0);
    }
    rollout.push_memory(&all);
}

/// Returns the masks of agents in their present states, one after the other; nothing if no agent has one. All actions
/// of agents without a mask are legal.
fn masks(world: &World, agents: impl Iterator<Item = Entity> + Clone) -> Vec<bool> {
    let mut all = Vec::new();
    if !agents.clone().any(|agent| world.get::<LegalActions>(agent).is_some()) {
        return all;
    }
    for agent in agents {
        let Some(Agent { actions, .. }) = world.get(agent) else { continue };
        match world.get::<LegalActions>(agent) {
            Some(legal) => all.extend(legal.entries(actions)),
            None => all.extend(std::iter::repeat_n(true, actions.mask_width())),
        }
    }
    all
}

// Saved arenas in the middle of their episodes.
//
// Games do not store their state: they are deterministic, so level and past actions restore it.

/// Saved state of one arena.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArenaState {
    /// Level of the current episode; `None` between two episodes.
    level: Option<u64>,
    actions: Actions,
    state_hash: u64,
    skill: Vec<f32>,
    skill_ticks_left: u32,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    memory: Vec<f32>,
    /// What a policy over skills remembers.
    #[serde(default, skip_serializing_if = "SkillMemory::is_empty")]
    skill_memory: SkillMemory,
    streams: [RngState; 3],
}

impl ArenaState {
    /// Returns the state of an arena before its first episode, whose agent has these random streams.
    pub(crate) fn begun(space: &ActionSpace, streams: &AgentStreams) -> Self {
        Self {
            level: None,
            actions: Actions::empty(space),
            state_hash: 0,
            skill: Vec::new(),
            skill_ticks_left: 0,
            memory: Vec::new(),
            skill_memory: SkillMemory::default(),
            streams: [&streams.level, &streams.action, &streams.skill].map(RngState::of),
        }
    }

    /// Returns the state of an arena that leaves its episode, in a World where none has begun.
    pub(crate) fn left(&self, space: &ActionSpace) -> Self {
        Self { streams: self.streams.clone(), ..Self::begun(space, &AgentStreams::default()) }
    }
}

/// Failure to restore an arena.
#[derive(Debug, Error)]
pub enum RestoreError {
    /// The game broke its contract while the arenas were replayed.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The replayed arena differs from the saved one.
    #[error(
        "arena {0} did not replay to its saved state: the game's rules have changed since the checkpoint, or the game keeps \
         state from one episode to the next. Look for resources that a restart does not reset, elapsed time (`Time`), a \
         `Local` of a system, a `static`, a random generator that is not seeded from the level, or the order of stored \
         entities. `playbot doctor` names such state. In a `Local`, a `static`, an asset, a type without `Reflect` or a \
         field with `#[reflect(ignore)]`, it sees only the effects on agents. If a foreign game cannot reset its state, use \
         `Restart::Rebuild`, which builds a new World for each episode"
    )]
    Diverged(usize),
    /// The checkpoint has another number of arenas.
    #[error("the checkpoint has {saved} arenas, the experiment {wanted}")]
    Count {
        /// Arenas in the checkpoint.
        saved: usize,
        /// Arenas of the experiment.
        wanted: usize,
    },
    /// The checkpoint lacks the policy of a rival.
    #[error("the checkpoint has no policy for rival {0}, which plays in one of its episodes")]
    Rival(usize),
    /// Unreadable generator state, or an action outside the game's space.
    #[error(transparent)]
    Stream(#[from] playbot_learner::LearnError),
}

/// Reads the state of every arena, in the order of the agents.
pub fn save_arenas(collector: &mut Collector) -> Vec<ArenaState> {
    let agents = collector.agents().to_vec();
    let world = collector.world_mut();
    let mut query = world.query::<(
        (&Agent, &Episode, &ActionLog, &StateHash),
        (&ActiveSkill, &SkillMemory),
        &AgentStreams,
        &AgentMemory,
    )>();
    agents
        .iter()
        .filter_map(|&agent| query.get(world, agent).ok())
        .map(|((agent, episode, log, hash), (skill, skill_memory), streams, memory)| ArenaState {
            level: episode.is_running().then_some(episode.level),
            actions: collect_actions(&agent.actions, &log.0),
            state_hash: hash.0,
            skill: skill.z.clone(),
            skill_ticks_left: skill.ticks_left,
            memory: memory.0.clone(),
            skill_memory: skill_memory.clone(),
            streams: [&streams.level, &streams.action, &streams.skill].map(RngState::of),
        })
        .collect()
}

fn collect_actions(space: &ActionSpace, log: &[ActionValue]) -> Actions {
    let mut actions = Actions::empty(space);
    for action in log {
        // The log holds the agent's action, which was checked against its space.
        if let Err(error) = actions.push(action) {
            tracing::error!("an action is missing from the checkpoint: {error}");
        }
    }
    actions
}

/// Brings every arena of a fresh collector to its saved state.
///
/// # Errors
///
/// [`RestoreError`] if the arenas differ in number or do not replay.
pub fn restore_arenas(collector: &mut Collector, saved: &[ArenaState]) -> Result<(), RestoreError> {
    let agents = collector.agents().to_vec();
    if agents.len() != saved.len() {
        return Err(RestoreError::Count { saved: saved.len(), wanted: agents.len() });
    }
    let world = collector.world_mut();
    for (&agent, state) in agents.iter().zip(saved) {
        if let Some(agent) = world.get::<Agent>(agent) {
            // A game gets only actions of its own space, even from a damaged file.
            agent.actions.check(&state.actions)?;
        }
    }
    let queues: Vec<_> = agents.iter().map(|&agent| world.get::<LevelQueue>(agent).cloned()).collect();
    for (&agent, state) in agents.iter().zip(saved) {
        let control = if state.level.is_some() { Control::Replay } else { Control::Idle };
        world.entity_mut(agent).insert((control, LevelQueue::Always(state.level.unwrap_or_default())));
    }
    replay(world, &agents, saved)?;
    for (row, (&agent, state)) in agents.iter().zip(saved).enumerate() {
        let mut entity = world.entity_mut(agent);
        if state.level.is_some() && entity.get::<StateHash>().is_none_or(|hash| hash.0 != state.state_hash) {
            return Err(RestoreError::Diverged(row));
        }
        let [level, action, skill] = &state.streams;
        let streams = AgentStreams::restored(level.restore()?, action.restore()?, skill.restore()?);
        let active = ActiveSkill { z: state.skill.clone(), ticks_left: state.skill_ticks_left };
        let log = ActionLog((0..state.actions.len()).filter_map(|tick| state.actions.get(tick)).collect());
        let memories = (AgentMemory(state.memory.clone()), state.skill_memory.clone());
        entity.insert((Control::Policy, streams, active, log, memories));
        if let Some(queue) = &queues[row] {
            entity.insert(queue.clone());
        }
    }
    Ok(())
}

/// Plays the saved actions; arenas at their saved tick stand still.
fn replay(world: &mut World, agents: &[Entity], saved: &[ArenaState]) -> Result<(), Fault> {
    let longest = saved.iter().map(|state| state.actions.len()).max().unwrap_or(0);
    for tick in 0..longest {
        for (&agent, state) in agents.iter().zip(saved) {
            match state.actions.get(tick) {
                Some(action) => world.entity_mut(agent).insert(bevy_playbot::action::Action(action)),
                None => world.entity_mut(agent).insert(Control::Idle),
            };
        }
        tick_world(world)?;
    }
    Ok(())
}
