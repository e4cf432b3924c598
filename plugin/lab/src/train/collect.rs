//! Collection of rollouts: a World that plays with the current policy.

use bevy::prelude::*;
use playbot_learner::{LearnError, ObsColumns, ObsKind, Observations, Policy, Rollout};

use super::{
    agents_tick::AgentsTick,
    cut_episodes::{CutEpisodes, cut_episodes, push_state},
};
use crate::{game::Game, sensors::GameSensors, split::LevelSplit, worlds::build_observing_world};
use bevy_playbot::{
    action::{Action, ActionValue},
    agent::{Agent, AgentOrder},
    control::Control,
    demo::recorder,
    episode::{Episode, EpisodeEnd, EpisodeEnded},
    fault::{Fault, Faults},
    headless::tick_world,
    level::LevelQueue,
    placement::TickSchedules,
    policy::{ActionDraw, ActivePolicy, Decision},
    policy_batch::PolicyBatch,
    renewal::Renewal,
    reward::Reward,
    shared_batch::SharedBatch,
    skill_prior::{ActiveSkill, SkillPrior, draw_skills},
    streams::AgentStreams,
    systems::{ObserveSchedule, PlaybotSystems},
    vision::{ObservationConfig, VisionError},
};

/// A World of arenas that fills rollouts.
pub struct Collector {
    world: World,
    agents: Vec<Entity>,
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

/// Episodes that ended during the rollout, in the order of ticks and agents.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
struct Finished(Vec<EpisodeEnded>);

fn note_finished(event: On<EpisodeEnded>, mut finished: ResMut<Finished>) {
    finished.0.push(*event);
}

/// Actions of the current episode.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub(super) struct ActionLog(pub(super) Vec<ActionValue>);

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
        Ok(Self { world, agents })
    }

    /// Plays `steps` ticks with this policy; `latent` is the width of the skills to keep, 0 for no skills.
    ///
    /// Returns the rollout, `[steps, agents]`, and the episodes that ended in it.
    ///
    /// # Errors
    ///
    /// The game's first breach of contract, with agent, level and tick.
    pub fn collect(
        &mut self,
        policy: &Policy,
        latent: usize,
        steps: usize,
    ) -> Result<(Rollout, Vec<EpisodeEnded>), Fault> {
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
    ) -> Result<(Rollout, Vec<EpisodeEnded>), Fault> {
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
    ) -> Result<(Rollout, Vec<EpisodeEnded>), Fault> {
        let world = &mut self.world;
        world.insert_resource(ActivePolicy { policy: policy.clone(), draw: ActionDraw::Sample });
        let kind = world.resource::<Collecting>().kind;
        let empty = Rollout::new(self.agents.len(), kind, latent, &policy.action_space());
        world.resource_mut::<Collecting>().rollout = empty.clone();
        for _ in 0..steps {
            tick_world(world)?;
            let seen = world.resource::<PolicyBatch>().observations();
            columns.fill_next(seen.as_slice()).map_err(|error| Fault(error.to_string()))?;
        }
        let mut rollout = std::mem::replace(&mut world.resource_mut::<Collecting>().rollout, empty);
        bootstrap_values(world, policy, &mut rollout).map_err(|error| Fault(error.to_string()))?;
        world.resource_mut::<Faults>().take()?;
        Ok((rollout, std::mem::take(&mut world.resource_mut::<Finished>().0)))
    }

    /// Returns the World, for saving and restoring its arenas.
    pub(crate) fn world_mut(&mut self) -> &mut World {
        &mut self.world
    }

    /// Returns the agents, in the order of their numbers.
    pub fn agents(&self) -> &[Entity] {
        &self.agents
    }
}

/// Adds the states in which the rollout stopped, with the skills active there, and their values.
///
/// Agents between two episodes have no such state. Their row is 0 and is never used, since their last row ended an
/// episode.
fn bootstrap_values(world: &mut World, policy: &Policy, rollout: &mut Rollout) -> Result<(), LearnError> {
    world.run_schedule(ObserveSchedule);
    if world.contains_resource::<SkillPrior>()
        && let Err(error) = world.run_system_cached(draw_skills)
    {
        world.resource_mut::<Faults>().report(error.to_string());
    }
    let entities = world.resource::<AgentOrder>().entities().to_vec();
    let running: Vec<_> = (0..entities.len())
        .filter(|&row| world.get::<Episode>(entities[row]).is_some_and(Episode::is_running))
        .collect();
    let kind = rollout.obs_kind;
    let (mut skills, mut left, mut observations) = (Vec::new(), Vec::new(), Observations::empty(&kind));
    for &row in &running {
        push_state(world, entities[row], &mut skills, &mut left, &mut observations);
    }
    let values = policy.values_held(&skills, &left, &observations, running.len())?;
    let latent = rollout.latent;
    rollout.next_values = vec![0.0; entities.len()];
    rollout.ends.next_obs = Observations::zeros(&kind, entities.len());
    rollout.ends.next_z = vec![0.0; entities.len() * latent];
    // A prior may exist without running agents.
    let counted = if world.contains_resource::<SkillPrior>() { entities.len() } else { 0 };
    rollout.ends.next_left = vec![1.0; counted];
    for (i, (&row, value)) in running.iter().zip(values).enumerate() {
        rollout.next_values[row] = value;
        if let Some(&left) = left.get(i) {
            rollout.ends.next_left[row] = left;
        }
        rollout.ends.next_obs.set_row(row, observations.row(i, kind.numbers()))?;
        rollout.ends.next_z[row * latent..(row + 1) * latent].copy_from_slice(&skills[i * latent..(i + 1) * latent]);
    }
    Ok(())
}

/// Appends one row per agent to the rollout.
fn collect_tick(world: &mut World) {
    let Some(policy) = world.get_resource::<ActivePolicy>().map(|active| active.policy.clone()) else {
        // Arenas are being restored, not played.
        return;
    };
    // The rollout is put back even if the tick fails.
    let pushed = world.try_resource_scope(|world, mut collecting: Mut<Collecting>| {
        let entities = world.resource::<AgentOrder>().entities().to_vec();
        let kind = collecting.kind;
        let cut = cut_episodes(world, &entities, &policy, &kind)?;
        let mut final_values = vec![0.0; entities.len()];
        for (&row, &value) in cut.agents.iter().zip(&cut.values) {
            final_values[row] = value;
        }
        let tick = tick_of(world, &entities, AgentsTick::new(&policy, &kind))?;
        collecting.rollout.push_left(world.resource::<PolicyBatch>().left());
        push_tick(&mut collecting.rollout, &tick, &final_values, &cut)
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
    Ok(())
}
