//! The agent: whoever acts in the game, be it a person, a script or a policy.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{agent::AgentOrder, prelude::*};
//!
//! let mut app = headless_app();
//! let second = app.world_mut().spawn(Agent::new(1, ActionSpace::Continuous(2))).id();
//! let first = app.world_mut().spawn(Agent::new(0, ActionSpace::Continuous(2))).id();
//! app.tick().expect("each has a number of its own");
//! assert_eq!(app.world().resource::<AgentOrder>().entities(), [first, second]);
//! // What is kept of every agent came along, and nobody plays yet.
//! assert_eq!(app.world().get::<Control>(first), Some(&Control::Idle));
//! ```

use bevy::prelude::*;
use playbot_learner::ActionSpace;

use crate::{control::Control, fault::Faults, level::LevelQueue, reward::Reward, state_hash::StateHash};

/// An entity that acts in the game.
///
/// Everything else that is kept per agent comes along as required components; each part of the
/// [`PlaybotPlugin`](crate::plugin::PlaybotPlugin) registers what it adds: action, episode, observation, random streams,
/// policy and skill. Add a [`VectorSensor`](crate::observation::VectorSensor) for what the agent sees and set its
/// [`Control`].
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
#[require(Control, LevelQueue, Reward, StateHash)]
pub struct Agent {
    /// Number of the agent, unique in its World. Random streams and the order of batches come from it, so that a run
    /// does not depend on the order in which entities were stored.
    pub index: u32,
    /// What the agent can do.
    pub actions: ActionSpace,
}

impl Agent {
    /// An agent with this number and these actions.
    pub fn new(index: u32, actions: ActionSpace) -> Self {
        Self { index, actions }
    }
}

/// All agents of the World in the order of their numbers: the row order of every batch.
#[derive(Resource, Default, Debug, Reflect)]
#[reflect(Resource)]
pub struct AgentOrder(Vec<Entity>);

impl AgentOrder {
    /// Agents, lowest number first.
    pub fn entities(&self) -> &[Entity] {
        &self.0
    }
}

/// Most agents that the World of a game can hold.
#[derive(Resource, Clone, Copy, Debug, Reflect)]
#[reflect(Resource)]
// Hidden here and below: for playbot_lab, playbot_cli and tests; games need none of it.
#[doc(hidden)]
pub struct AgentLimit {
    /// Name of the game.
    pub game: &'static str,
    /// The number.
    pub most: u32,
}

/// Whether nothing can be done in this space.
#[doc(hidden)]
pub fn has_no_actions(space: &ActionSpace) -> bool {
    matches!(space, ActionSpace::Discrete(0) | ActionSpace::Continuous(0))
}

/// Reports agents that cannot do anything, and more of them than the game bears, and stops those.
pub(crate) fn check_agents(
    limit: Option<Res<AgentLimit>>,
    mut agents: Query<(Ref<Agent>, &mut Control)>,
    mut faults: ResMut<Faults>,
) {
    if let Some(limit) = limit.filter(|limit| agents.iter().len() > limit.most as usize) {
        faults.report(format!(
            "a World of the game `{}` has room for {} agent{}, since they would share its player and its resources, but it has {}: build more Worlds",
            limit.game,
            limit.most,
            if limit.most == 1 { "" } else { "s" },
            agents.iter().len()
        ));
        agents.iter_mut().for_each(|(_, mut control)| *control = Control::Idle);
        return;
    }
    for (agent, mut control) in &mut agents {
        if agent.is_added() && has_no_actions(&agent.actions) {
            faults.report(format!("agent {} has no actions: say what it can do", agent.index));
            *control = Control::Idle;
        }
    }
}

/// Keeps [`AgentOrder`] true when agents come or go, and reports numbers that two of them share.
pub(crate) fn order_agents(
    mut order: ResMut<AgentOrder>,
    agents: Query<(Entity, &Agent)>,
    added: Query<(), Added<Agent>>,
    mut faults: ResMut<Faults>,
) {
    let unchanged = added.is_empty() && order.0.len() == agents.iter().len();
    if unchanged {
        return;
    }
    let mut sorted: Vec<_> = agents.iter().map(|(entity, agent)| (agent.index, entity)).collect();
    sorted.sort();
    for pair in sorted.windows(2) {
        if let &[(index, one), (other_index, other)] = pair
            && index == other_index
        {
            faults.report(format!(
                "two agents have the number {index}: {one} and {other}; give each agent of a World a number of its own in \
                 `Agent::new`"
            ));
        }
    }
    order.0 = sorted.into_iter().map(|(_, entity)| entity).collect();
}
