//! Agents: the entities that act in the game, played by a person, a script or a policy.
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
//! // The required components are there, and the agent is idle.
//! assert_eq!(app.world().get::<Control>(first), Some(&Control::Idle));
//! ```
//!
//! # The source of an agent's actions
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//!
//! let mut app = headless_app();
//! let agent = app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human)).id();
//! app.ticks(3).expect("no agent broke its contract");
//! // A script takes over in the middle of the episode.
//! app.world_mut().entity_mut(agent).insert((Control::Bot, BlindBot::Constant(ActionValue::Discrete(1))));
//! app.ticks(2).expect("no agent broke its contract");
//! assert_eq!(app.world().get::<Action>(agent), Some(&Action(ActionValue::Discrete(1))));
//! assert_eq!(app.world().get::<Episode>(agent).expect("every agent has one").tick, 5);
//! ```

use crate::{
    carry_over::{ReflectCarryComponent, ReflectCarryResource},
    fault::Faults,
    level::LevelQueue,
    reward::Reward,
    state_hash::StateHash,
};
use bevy::prelude::*;
use playbot_learner::ActionSpace;

/// An entity that acts in the game.
///
/// Required components bring everything else that is kept per agent. Each part of the
/// [`PlaybotPlugin`](crate::plugin::PlaybotPlugin) registers its own: action, episode, observation,
/// random streams, policy and skill. Add a [`VectorSensor`](crate::observation::VectorSensor) for
/// its observations and set its [`Control`].
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
#[require(Control, LevelQueue, Reward, StateHash)]
pub struct Agent {
    /// Number of the agent, unique in its World. Random streams and the order of batches derive
    /// from it, so a run does not depend on the storage order of entities.
    pub index: u32,
    /// The actions that the agent can take.
    pub actions: ActionSpace,
}

impl Agent {
    /// Creates an agent with this number and these actions.
    pub fn new(index: u32, actions: ActionSpace) -> Self {
        Self { index, actions }
    }
}

/// Marks an agent that plays along with another one, which is played by a person, a tester or a replay. It has no levels
/// of its own: the game begins its episodes with [`begin_beside`](crate::engine::begin_beside), and nothing counts their
/// results.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component)]
pub struct PlaysAlong;

/// All agents of the World in the order of their numbers: the row order of every batch.
#[derive(Resource, Default, Debug, Reflect)]
#[reflect(Resource, CarryResource)]
pub struct AgentOrder(Vec<Entity>);

impl AgentOrder {
    /// Agents, lowest number first.
    pub fn entities(&self) -> &[Entity] {
        &self.0
    }
}

/// Largest number of agents that the World of a game can hold.
#[derive(Resource, Clone, Copy, Debug, Reflect)]
#[reflect(Resource)]
pub struct AgentLimit {
    /// Name of the game.
    pub game: &'static str,
    /// The limit.
    pub most: u32,
}

/// Returns whether the space holds no action.
pub fn has_no_actions(space: &ActionSpace) -> bool {
    space.is_empty()
}

/// Reports agents without any action, and agents above the game's limit, and stops those.
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
            faults.report(format!("agent {} has no actions: give its action space at least one", agent.index));
            *control = Control::Idle;
        }
    }
}

/// Keeps [`AgentOrder`] up to date as agents come and go, and reports numbers that two agents
/// share.
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

/// The source of the agent's [`Action`](crate::action::Action). May be changed at any tick.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Component, CarryComponent)]
pub enum Control {
    /// A person: the game turns input into actions.
    Human,
    /// A script: a [`BlindBot`](crate::bot::BlindBot) or a system of the game.
    Bot,
    /// The [`ActivePolicy`](crate::policy::ActivePolicy).
    Policy,
    /// A recording: [`Replay`](crate::demo::replay::Replay).
    Replay,
    /// No source: no episode is started, and a running one is paused. Games leave the arena of an
    /// idle agent alone.
    #[default]
    Idle,
}

impl Control {
    /// Returns the current source of an agent's actions, or [`Idle`](Self::Idle) for an entity that
    /// is no agent.
    pub fn of(world: &World, agent: Entity) -> Self {
        world.get::<Self>(agent).copied().unwrap_or_default()
    }

    /// Returns whether there is a source of actions, so that the game goes on.
    pub fn is_active(self) -> bool {
        self != Self::Idle
    }
}
