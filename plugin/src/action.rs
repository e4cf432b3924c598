//! The action of an agent in a tick.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//!
//! /// A system of the game: action 1 jumps.
//! fn jump(mut agents: Query<(&Action, &mut Transform)>) {
//!     for (action, mut body) in &mut agents {
//!         if action.discrete() == Some(1) {
//!             body.translation.y += 2.0;
//!         }
//!     }
//! }
//!
//! let mut app = headless_app();
//! app.add_systems(FixedUpdate, jump);
//! let agent = (Agent::new(0, ActionSpace::Discrete(2)), Control::Human, Action(ActionValue::Discrete(1)));
//! let agent = app.world_mut().spawn((agent, Transform::default())).id();
//! app.tick().expect("there is a choice 1");
//! assert_eq!(app.world().get::<Transform>(agent).expect("spawned with it").translation.y, 2.0);
//! ```

use crate::{
    agent::{Agent, Control},
    carry_over::ReflectCarryComponent,
    episode::Episode,
    fault::Faults,
};
use bevy::prelude::*;

pub use playbot_learner::{ActionSpace, ActionValue, Actions, Choices, MixedSpace};

/// The action of this tick. The holder of the [`Control`] writes it in
/// [`PlaybotSystems::Decide`](crate::systems::PlaybotSystems::Decide); the game reads it in
/// `FixedUpdate`.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, CarryComponent, Clone, Debug, PartialEq)]
pub struct Action(pub ActionValue);

impl Default for Action {
    fn default() -> Self {
        Self(ActionValue::Discrete(0))
    }
}

impl Action {
    /// Returns the index of a discrete action, or `None` for another one.
    pub fn discrete(&self) -> Option<u32> {
        match self.0 {
            ActionValue::Discrete(index) => Some(index),
            ActionValue::Continuous(_) | ActionValue::Mixed { .. } => None,
        }
    }

    /// Returns the numbers of a continuous or mixed action, or `None` for a discrete one.
    pub fn continuous(&self) -> Option<&[f32]> {
        match &self.0 {
            ActionValue::Discrete(_) => None,
            ActionValue::Continuous(values) | ActionValue::Mixed { numbers: values, .. } => Some(values),
        }
    }

    /// Returns the option taken of choice number `choice`, from 0: in a discrete action there is one choice.
    pub fn option(&self, choice: usize) -> Option<u32> {
        self.0.options().get(choice).copied()
    }
}

/// Gives every agent an action.
pub(crate) fn plugin(app: &mut App) {
    app.register_required_components::<Agent, Action>();
}

/// Returns why an action does not belong to its space, or `None` if it does.
pub fn misfit(action: &ActionValue, space: &ActionSpace) -> Option<String> {
    match (action, space) {
        (ActionValue::Discrete(index), ActionSpace::Discrete(n)) if (*index as usize) < *n => None,
        (ActionValue::Discrete(index), ActionSpace::Discrete(n)) => {
            Some(format!("discrete action {index} is outside of the numbers from 0 to {}", n.saturating_sub(1)))
        }
        (ActionValue::Continuous(values), ActionSpace::Continuous(n)) if values.len() != *n => {
            Some(format!("continuous action has {} values, the space has {n}", values.len()))
        }
        (ActionValue::Continuous(values), ActionSpace::Continuous(_)) => values
            .iter()
            .position(|value| !value.is_finite())
            .map(|at| format!("continuous action has {} at index {at}", values[at])),
        (ActionValue::Mixed { choices, numbers }, ActionSpace::Mixed(space)) => space
            .misfit(choices, numbers)
            .map(|why| format!("the action does not fit {}: {why}", ActionSpace::Mixed(*space))),
        (action, space) => Some(format!("action {action:?} does not fit {space}")),
    }
}

/// Reports actions outside their agent's space, with agent and tick, and stops those agents. The
/// game need not handle impossible actions.
pub fn check_actions(mut agents: Query<(&Agent, &Action, &Episode, &mut Control)>, mut faults: ResMut<Faults>) {
    for (agent, action, episode, mut control) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        if let Some(why) = misfit(&action.0, &agent.actions) {
            faults.report(format!("{}: {why}", episode.moment(agent)));
            *control = Control::Idle;
        }
    }
}
