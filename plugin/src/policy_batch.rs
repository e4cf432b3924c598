//! Decisions of the policy in a tick, for all agents of a World in one pass.

use bevy::prelude::*;
use playbot_learner::{ObsKind, Observations, Policy, PolicyOutput};

use crate::{
    observation::{Observation, start_batch},
    policy_rows::PolicyRows,
    shared_batch::SharedBatch,
    skill_prior::ActiveSkill,
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

    /// Returns the agents.
    pub(crate) fn agents(&self) -> &[Entity] {
        &self.agents
    }

    pub(crate) fn start(&mut self, kind: &ObsKind) {
        let PolicyRows { observations, skills, left, count } = &mut self.rows;
        start_batch(observations, kind);
        skills.clear();
        left.clear();
        *count = 0;
        self.agents.clear();
    }

    /// Adds an agent with its observation and its skill, which is drawn anew every `horizon` ticks.
    pub(crate) fn push(&mut self, agent: Entity, observation: &Observation, skill: &ActiveSkill, horizon: Option<u32>) {
        self.agents.push(agent);
        observation.push_to(&mut self.rows.observations);
        self.rows.skills.extend_from_slice(&skill.z);
        self.rows.left.extend(horizon.map(|horizon| skill.left(horizon)));
        self.rows.count += 1;
    }

    /// Decides in one pass, together with other Worlds if there are any.
    pub(crate) fn decide(&mut self, policy: &Policy, shared: Option<&SharedBatch>) -> Result<PolicyOutput, String> {
        match shared {
            Some(shared) => shared.decide(&mut self.rows),
            None => self.rows.decide(policy).map_err(|error| error.to_string()),
        }
    }
}
