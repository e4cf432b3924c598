//! Agents driven by a learned policy.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{policy::Decision, prelude::*};
//! # use playbot_learner::{DeviceKind, Learner as _, PolicySpec, PpoConfig, PpoLearner};
//! # let spec = PolicySpec { obs: 1.into(), latent: 0, action_space: ActionSpace::Discrete(3) };
//! # let policy = PpoLearner::new(PpoConfig::default(), spec, 1, DeviceKind::Flex).expect("good settings").policy();
//!
//! /// A system of the game.
//! fn see(mut agents: Query<&mut Observation>) {
//!     agents.iter_mut().for_each(|mut seen| seen.set([0.5]));
//! }
//!
//! let mut app = headless_app();
//! // `policy` reads one number and knows three actions.
//! app.insert_resource(ActivePolicy { policy, draw: ActionDraw::Sample })
//!     .insert_resource(PlaybotSeed(7))
//!     .add_systems(ObserveSchedule, see);
//! let agent = (Agent::new(0, ActionSpace::Discrete(3)), VectorSensor::new(["x"]), Control::Policy);
//! let agent = app.world_mut().spawn(agent).id();
//! app.tick().expect("the policy fits the game");
//! let decision = app.world().get::<Decision>(agent).expect("every agent has one");
//! assert!(decision.log_prob < 0.0, "it might have done something else");
//! ```

use crate::{
    action::Action,
    agent::{Agent, AgentOrder, Control},
    carry_over::{ReflectCarryComponent, ReflectCarryResource},
    episode::Episode,
    fault::Faults,
    legal::LegalActions,
    observation::Observation,
    policy_batch::{PolicyBatch, SharedBatch},
    skill_prior::{ActiveSkill, SkillPrior},
    streams::AgentStreams,
    vision::{ImageSensor, seen_as},
};
use bevy::prelude::*;
use playbot_learner::{ObsKind, Policy};

/// The choice of an action from the policy's distribution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
pub enum ActionDraw {
    /// A random draw.
    #[default]
    Sample,
    /// The most probable action.
    Greedy,
}

/// The policy that drives every agent under [`Control::Policy`].
#[derive(Resource, Clone, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, CarryResource, Clone)]
pub struct ActivePolicy {
    /// Actor and critic.
    pub policy: Policy,
    /// The choice of actions.
    pub draw: ActionDraw,
}

impl ActivePolicy {
    /// Lets the policy drive the agents of this World, with skills from this prior, or without.
    /// Replaces an earlier policy.
    pub fn install(self, world: &mut World, skills: Option<SkillPrior>) {
        world.insert_resource(self);
        match skills {
            Some(skills) => world.insert_resource(skills),
            None => drop(world.remove_resource::<SkillPrior>()),
        }
    }
}

/// The policy's estimates for the action of this tick.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, CarryComponent)]
pub struct Decision {
    /// Natural logarithm of the action's probability (density for continuous actions).
    pub log_prob: f32,
    /// Value estimate of the observed state.
    pub value: f32,
}

/// What the agent's policy remembers of the present episode. It is empty at first, and for a policy without memory.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, CarryComponent)]
pub struct AgentMemory(pub Vec<f32>);

/// Adds the components of a policy to every agent.
pub(crate) fn plugin(app: &mut App) {
    app.init_resource::<PolicyBatch>()
        .register_required_components::<Agent, Decision>()
        .register_required_components::<Agent, AgentMemory>();
}

/// Ends memories with their episode, under any control.
pub(crate) fn forget(mut agents: Query<(&Episode, &mut AgentMemory)>) {
    for (episode, mut memory) in &mut agents {
        if episode.is_running() && episode.tick == 0 && !memory.0.is_empty() {
            memory.0.clear();
        }
    }
}

/// Decides for all agents under [`Control::Policy`] in one batched forward pass, among their [`LegalActions`].
pub(crate) fn run_policy(
    active: Res<ActivePolicy>,
    (shared, prior): (Option<Res<SharedBatch>>, Option<Res<SkillPrior>>),
    order: Res<AgentOrder>,
    mut agents: Query<(
        &Agent,
        &Control,
        &Episode,
        (&Observation, Option<&ImageSensor>, Option<&LegalActions>),
        (&ActiveSkill, Option<&mut AgentMemory>),
        &mut AgentStreams,
        &mut Action,
        &mut Decision,
    )>,
    mut faults: ResMut<Faults>,
    mut batch: ResMut<PolicyBatch>,
) {
    let skill_interval = prior.map(|prior| prior.skill_interval);
    batch.start(&active.policy.observation());
    for &entity in order.entities() {
        let Ok((agent, control, episode, (observation, sensor, legal), (skill, memory), ..)) = agents.get(entity)
        else {
            continue;
        };
        if *control != Control::Policy || !episode.is_running() {
            continue;
        }
        if let Some(why) = misfit(&active.policy, agent, observation, sensor, skill) {
            faults.report(why);
            return;
        }
        let width = active.policy.memory();
        let Some(memory) = memory.map_or((width == 0).then_some(&[][..]), |memory| Some(&memory.0)) else {
            return faults.report(format!(
                "agent {}: the policy remembers {width} numbers, but the agent has no `AgentMemory`: insert \
                 `AgentMemory::default()`, which every `Agent` is spawned with",
                agent.index
            ));
        };
        batch.push((entity, agent), observation, legal, skill, skill_interval);
        batch.push_memory(memory, width);
    }
    if batch.agents().is_empty() {
        return;
    }
    let output = match batch.decide(&active.policy, shared.as_deref()) {
        Ok(output) => output,
        Err(error) => return faults.report(format!("the policy cannot decide: {error}")),
    };
    for (row, &entity) in batch.agents().iter().enumerate() {
        let Ok((.., (_, _, legal), (_, memory), mut streams, mut action, mut decision)) = agents.get_mut(entity) else {
            continue;
        };
        let (chosen, log_prob) = match active.draw {
            ActionDraw::Sample => output.sample(row, &mut streams.action),
            ActionDraw::Greedy => {
                let greedy = output.greedy(row);
                let log_prob = output.log_prob(row, &greedy).unwrap_or(0.0);
                (greedy, log_prob)
            }
        };
        if let (Some(mut memory), width @ 1..) = (memory, active.policy.memory()) {
            memory.0.clear();
            memory.0.extend_from_slice(&output.memory[row * width..(row + 1) * width]);
        }
        action.0 = chosen;
        if let Some(legal) = legal {
            legal.set_numbers(&mut action.0);
        }
        *decision = Decision { log_prob, value: output.values[row] };
    }
}

/// Returns why the policy cannot decide for this agent.
pub(crate) fn misfit(
    policy: &Policy,
    agent: &Agent,
    observation: &Observation,
    sensor: Option<&ImageSensor>,
    skill: &ActiveSkill,
) -> Option<String> {
    let (wanted, seen) = (policy.observation(), seen_as(&policy.observation(), observation, sensor));
    let spaces = (policy.latent(), policy.action_space());
    // A policy without skills ignores the skills of a prior.
    let skills_fit = spaces.0 == 0 || spaces.0 == skill.z.len();
    if skills_fit && (wanted, spaces.1) == (seen, agent.actions) {
        return None;
    }
    let way_out = match (wanted, seen) {
        (ObsKind::Image(_), ObsKind::Vector(_)) => {
            "give the agent a sensor that makes such pictures, or load a policy that reads vectors"
        }
        (ObsKind::Vector(_), ObsKind::Image(_)) => {
            "give the agent a `VectorSensor`, or load a policy that reads such pictures"
        }
        (ObsKind::Image(wanted), ObsKind::Image(seen)) if wanted != seen => {
            "set the sensor's `ImageOptions` to those of the policy, or load a policy for these pictures"
        }
        _ => "load a policy that was trained for this game",
    };
    Some(format!(
        "agent {}: the policy was made for {}, {} skill values and {}, but the game gives {}, {} and {}; {way_out}",
        agent.index,
        wanted.describe(),
        spaces.0,
        spaces.1,
        seen.describe(),
        skill.z.len(),
        agent.actions
    ))
}
