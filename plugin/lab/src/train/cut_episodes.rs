//! Episodes that ran out of time: their last states, and the values of these.

use bevy::prelude::*;
use bevy_playbot::{
    episode::{Episode, EpisodeEnd},
    observation::Observation,
    skill_prior::{ActiveSkill, SkillPrior},
    streams::AgentStreams,
    systems::ObserveSchedule,
};
use playbot_learner::{LearnError, ObsKind, Observations, Policy, rng::normal};

/// The last states of the episodes that ran out of time in one tick.
pub(super) struct CutEpisodes {
    pub(super) agents: Vec<usize>,
    pub(super) obs: Observations,
    pub(super) z: Vec<f32>,
    /// Remaining ticks of these skills; empty without a prior.
    pub(super) left: Vec<f32>,
    pub(super) values: Vec<f32>,
}

impl CutEpisodes {
    pub(super) fn new(agents: Vec<usize>, kind: &ObsKind) -> Self {
        Self { agents, obs: Observations::empty(kind), z: Vec::new(), left: Vec::new(), values: Vec::new() }
    }
}

/// Returns the last state of each episode that ran out of time in this tick, with its value.
///
/// The skill is the agent's present one. If it has just run out, the next one is drawn from a copy of the agent's
/// stream. The next draw of the stream itself belongs to the next episode.
pub(super) fn cut_episodes(
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
    world.run_schedule(ObserveSchedule);
    for (i, &row) in cut.agents.iter().enumerate() {
        let skill_from = cut.z.len();
        push_state(world, entities[row], &mut cut.z, &mut cut.left, &mut cut.obs);
        let held = world.get::<ActiveSkill>(entities[row]).is_some_and(|skill| skill.ticks_left > 0);
        let streams = world.get::<AgentStreams>(entities[row]);
        if let (false, Some(prior), Some(streams)) = (held, world.get_resource::<SkillPrior>(), streams) {
            let (last, mut stream) = (cut.obs.row(i, kind.numbers()), streams.skill.clone());
            let drawn = prior.prior.sample(last, 1, prior.draw, &mut |_| normal(&mut stream))?;
            cut.z.truncate(skill_from);
            cut.z.extend(drawn);
        }
    }
    cut.values = policy.values_held(&cut.z, &cut.left, &cut.obs, cut.agents.len())?;
    // The current row belongs to the state before the action.
    for (&entity, before) in entities.iter().zip(before) {
        if let (Some(before), Some(mut observation)) = (before, world.get_mut::<Observation>(entity)) {
            *observation = before;
        }
    }
    Ok(cut)
}

/// Adds an agent's present observation, its skill, and the skill's remaining ticks.
pub(super) fn push_state(
    world: &World,
    entity: Entity,
    skills: &mut Vec<f32>,
    left: &mut Vec<f32>,
    observations: &mut Observations,
) {
    if let (Some(skill), Some(observation)) = (world.get::<ActiveSkill>(entity), world.get::<Observation>(entity)) {
        skills.extend_from_slice(&skill.z);
        left.extend(world.get_resource::<SkillPrior>().map(|prior| skill.left(prior.horizon)));
        observation.push_to(observations);
    }
}
