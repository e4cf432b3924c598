//! Policies of single agents, beside the one that drives all others: those of rivals.

use crate::{
    action::Action,
    agent::{Agent, AgentOrder, Control},
    carry_over::ReflectCarryComponent,
    episode::Episode,
    fault::Faults,
    legal::LegalActions,
    observation::Observation,
    policy::{ActionDraw, AgentMemory, misfit},
    policy_batch::PolicyBatch,
    skill_prior::{ActiveSkill, SkillMemory, SkillPrior},
    streams::AgentStreams,
    vision::ImageSensor,
};
use bevy::prelude::*;
use playbot_learner::{Observations, Policy, PolicyOutput, rng::normal};

/// A policy that plays this agent alone, with skills of its own, while the agent's control is [`Control::Bot`]. The World's
/// [`ActivePolicy`](crate::policy::ActivePolicy) drives agents under [`Control::Policy`]. It takes the place of a bot of an
/// agent that [plays along](crate::agent::PlaysAlong): take other bots away from the agent.
#[derive(Component, Clone, Reflect)]
#[reflect(opaque)]
#[reflect(Component, CarryComponent, Clone)]
pub struct OwnPolicy {
    /// Actor and critic.
    pub policy: Policy,
    /// The choice of actions.
    pub draw: ActionDraw,
    /// The source of its skills, if it reads any.
    pub skills: Option<SkillPrior>,
}

/// Decides for each agent with a policy of its own, in the order of their numbers.
pub(crate) fn run_own_policies(
    order: Res<AgentOrder>,
    mut agents: Query<(
        (&Agent, &Control, &Episode, &OwnPolicy),
        (&Observation, Option<&ImageSensor>, Option<&LegalActions>),
        (&mut ActiveSkill, &mut SkillMemory, &mut AgentMemory),
        &mut AgentStreams,
        &mut Action,
    )>,
    mut batch: Local<PolicyBatch>,
    mut faults: ResMut<Faults>,
) {
    for &entity in order.entities() {
        let Ok(((agent, control, episode, own), seen, (mut skill, mut past, mut memory), mut streams, mut action)) =
            agents.get_mut(entity)
        else {
            continue;
        };
        if *control != Control::Bot || !episode.is_running() {
            continue;
        }
        let (observation, sensor, legal) = seen;
        if let Err(why) = draw_skill(own, observation, (&mut skill, &mut past), &mut streams) {
            return faults.report(format!("{}: the skill prior cannot draw: {why}", episode.moment(agent)));
        }
        if let Some(why) = misfit(&own.policy, agent, observation, sensor, &skill) {
            return faults.report(why);
        }
        let width = own.policy.memory();
        batch.start(&own.policy.observation());
        batch.push(
            (entity, agent),
            observation,
            legal,
            &skill,
            own.skills.as_ref().map(|skills| skills.skill_interval),
        );
        batch.push_memory(&memory.0, width);
        let output = match batch.decide(&own.policy, None) {
            Ok(output) => output,
            Err(error) => {
                return faults.report(format!("{}: the policy cannot decide: {error}", episode.moment(agent)));
            }
        };
        action.0 = match own.draw {
            ActionDraw::Sample => output.sample(0, &mut streams.action).0,
            ActionDraw::Greedy => output.greedy(0),
        };
        remember(&mut memory, &output, width);
    }
}

/// Draws a skill from the policy's own prior, if it has one and the last skill has run out.
fn draw_skill(
    own: &OwnPolicy,
    observation: &Observation,
    (skill, memory): (&mut ActiveSkill, &mut SkillMemory),
    streams: &mut AgentStreams,
) -> Result<(), String> {
    let Some(SkillPrior { prior, skill_interval, draw }) = own.skills.as_ref().filter(|_| skill.ticks_left == 0) else {
        return Ok(());
    };
    let mut seen = Observations::empty(&own.policy.observation());
    observation.push_to(&mut seen);
    let before = if memory.now.len() == prior.memory() { std::mem::take(&mut memory.now) } else { Vec::new() };
    let drawn = prior.sample_remembering(&seen, &before, 1, *draw, &mut |_| normal(&mut streams.skill));
    let (z, now) = drawn.map_err(|error| error.to_string())?;
    *memory = SkillMemory { before, now };
    *skill = ActiveSkill { z, ticks_left: *skill_interval };
    Ok(())
}

fn remember(memory: &mut AgentMemory, output: &PolicyOutput, width: usize) {
    if width > 0 {
        memory.0.clear();
        memory.0.extend_from_slice(&output.memory[..width]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{prelude::*, streams::AgentStreams};
    use playbot_learner::{DeviceKind, Learner as _, PolicySpec, PpoConfig, PpoLearner};

    fn policy(seed: u64) -> Policy {
        let spec = PolicySpec { obs: 1.into(), latent: 0, action_space: ActionSpace::Discrete(5) };
        PpoLearner::new(PpoConfig::default(), spec, seed, DeviceKind::Flex).expect("good settings").policy()
    }

    /// Returns the actions of two agents under the World's policy, the second with a policy of its own if there is one.
    fn actions(own: Option<Policy>) -> Vec<[Option<u32>; 2]> {
        let mut app = headless_app();
        app.insert_resource(ActivePolicy { policy: policy(1), draw: ActionDraw::Sample }).add_systems(
            ObserveSchedule,
            |mut agents: Query<&mut Observation>| {
                agents.iter_mut().for_each(|mut seen| seen.set([0.5]));
            },
        );
        let agents = [0, 1].map(|index| {
            let agent = (Agent::new(index, ActionSpace::Discrete(5)), VectorSensor::new(["x"]), Control::Policy);
            app.world_mut().spawn((agent, AgentStreams::new(3, 7))).id()
        });
        if let Some(policy) = own {
            let own = OwnPolicy { policy, draw: ActionDraw::Sample, skills: None };
            app.world_mut().entity_mut(agents[1]).insert((own, Control::Bot));
        }
        let chosen = |app: &App, agent| app.world().get::<Action>(agent).and_then(Action::discrete);
        // Untrained policies differ little, and so do their draws.
        (0..3000)
            .map(|_| {
                app.tick().expect("no agent broke its contract");
                agents.map(|agent| chosen(&app, agent))
            })
            .collect()
    }

    #[test]
    fn an_agent_acts_by_its_own_policy_and_the_others_by_that_of_the_world() {
        let (alone, same, other) = (actions(None), actions(Some(policy(1))), actions(Some(policy(2))));
        assert!(alone.iter().all(|[one, two]| one == two), "both have the same streams");
        assert_eq!(same, alone, "the same policy decides the same, in a pass of its own");
        assert!(other.iter().map(|actions| actions[0]).eq(alone.iter().map(|actions| actions[0])));
        assert!(other.iter().any(|[one, two]| one != two));
    }

    #[test]
    fn a_policy_of_another_observation_is_a_fault_with_the_difference() {
        let mut app = headless_app();
        let agent = (Agent::new(0, ActionSpace::Discrete(4)), VectorSensor::new(["x"]), Control::Bot);
        let agent = app.world_mut().spawn(agent).id();
        app.add_systems(ObserveSchedule, |mut agents: Query<&mut Observation>| {
            agents.iter_mut().for_each(|mut seen| seen.set([0.5]));
        });
        let own = OwnPolicy { policy: policy(1), draw: ActionDraw::Greedy, skills: None };
        app.world_mut().entity_mut(agent).insert(own);
        let fault = app.tick().expect_err("it has four actions, and the policy knows five").to_string();
        assert!(fault.contains("5 discrete actions") && fault.contains("4 discrete actions"), "{fault}");
    }
}
