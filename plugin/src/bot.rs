//! Bots that do not look: the baselines that any learner has to beat.
//!
//! ```
//! use std::collections::BTreeSet;
//!
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//!
//! let mut app = headless_app();
//! let agent = (Agent::new(0, ActionSpace::Discrete(4)), Control::Bot, BlindBot::Uniform);
//! let agent = app.world_mut().spawn(agent).id();
//! let mut seen = BTreeSet::new();
//! for _ in 0..100 {
//!     app.tick().expect("no agent broke its contract");
//!     seen.extend(app.world().get::<Action>(agent).and_then(Action::discrete));
//! }
//! assert_eq!(seen, BTreeSet::from([0, 1, 2, 3]));
//! ```

use bevy::prelude::*;
use playbot_learner::{Action as ActionValue, ActionSpace, rng::normal};
use rand::RngExt;

use crate::{action::Action, agent::Agent, control::Control, episode::Episode, streams::AgentStreams};

/// A scripted bot without eyes. Acts while the agent's control is [`Control::Bot`].
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub enum BlindBot {
    /// The same action in every tick.
    Constant(ActionValue),
    /// Uniformly random: over the indices of a discrete space, over [-1, 1] per continuous value.
    Uniform,
}

pub(crate) fn run_blind_bots(
    mut agents: Query<(&Agent, &Control, &BlindBot, &Episode, &mut AgentStreams, &mut Action)>,
) {
    for (agent, control, bot, episode, mut streams, mut action) in &mut agents {
        if *control != Control::Bot || !episode.is_running() {
            continue;
        }
        match bot {
            BlindBot::Constant(value) => action.0.clone_from(value),
            BlindBot::Uniform => action.0 = uniform(&agent.actions, &mut streams.action),
        }
    }
}

/// A uniformly random action of a space.
// Hidden here and below: for playbot_lab, playbot_cli and tests; games need none of it.
#[doc(hidden)]
pub fn uniform(space: &ActionSpace, rng: &mut impl rand::Rng) -> ActionValue {
    match space {
        ActionSpace::Discrete(n) => ActionValue::Discrete(rng.random_range(0..*n as u32)),
        ActionSpace::Continuous(n) => ActionValue::Continuous((0..*n).map(|_| rng.random_range(-1.0..=1.0)).collect()),
    }
}

/// What a demonstrator plans to do, with noise: the probability with which a discrete action is replaced by a uniformly
/// random one, or the standard deviation of the normal noise on each value of a continuous one. Without noise nothing is drawn
/// and the action stays what it is.
#[doc(hidden)]
pub fn with_noise(planned: ActionValue, space: &ActionSpace, noise: f64, rng: &mut impl rand::Rng) -> ActionValue {
    match planned {
        ActionValue::Discrete(_) if noise > 0.0 && rng.random_bool(noise.min(1.0)) => uniform(space, rng),
        ActionValue::Continuous(values) if noise > 0.0 => {
            let noisy = |value: f32| (value + noise as f32 * normal(rng)).clamp(-1.0, 1.0);
            ActionValue::Continuous(values.into_iter().map(noisy).collect())
        }
        planned => planned,
    }
}
