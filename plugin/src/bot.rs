//! Bots without sensors: the baselines that every learner has to beat.
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

use crate::{
    action::Action,
    agent::{Agent, Control},
    carry_over::ReflectCarryComponent,
    episode::Episode,
    legal::LegalActions,
    streams::AgentStreams,
};
use bevy::prelude::*;
use playbot_learner::{ActionSpace, ActionValue, MixedSpace, rng::normal};
use rand::RngExt;

/// A scripted bot without sensors. Acts while the agent's control is [`Control::Bot`].
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, CarryComponent, Clone, Debug, PartialEq)]
#[require(HeldAction)]
pub enum BlindBot {
    /// The same action in every tick.
    Constant(ActionValue),
    /// Uniformly random: over the indices of a discrete space or of each choice, over [-1, 1] per continuous value.
    Uniform,
    /// Chaos: uniformly random actions, each held for a uniformly random number of ticks from 1 to
    /// 30. It begins anew in every episode.
    Chaos,
}

/// Longest time for which chaos holds an action, in ticks.
const LONGEST_HOLD: u32 = 30;

/// The action that [`BlindBot::Chaos`] holds.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct HeldAction {
    action: Action,
    /// Remaining ticks.
    left: u32,
}

impl HeldAction {
    /// Returns the action of this tick of the episode.
    fn next(
        &mut self,
        tick: u32,
        space: &ActionSpace,
        legal: Option<&LegalActions>,
        rng: &mut impl rand::Rng,
    ) -> &ActionValue {
        let is_legal = legal.is_none_or(|legal| legal.allows(&self.action.0));
        if tick == 0 || self.left == 0 || !is_legal {
            self.action = Action(legal_uniform(space, legal, rng));
            self.left = rng.random_range(1..=LONGEST_HOLD);
        }
        self.left -= 1;
        &self.action.0
    }
}

pub(crate) fn run_blind_bots(
    mut agents: Query<(
        &Agent,
        &Control,
        &BlindBot,
        &Episode,
        Option<&LegalActions>,
        &mut HeldAction,
        &mut AgentStreams,
        &mut Action,
    )>,
) {
    for (agent, control, bot, episode, legal, mut held, mut streams, mut action) in &mut agents {
        if *control != Control::Bot || !episode.is_running() {
            continue;
        }
        match bot {
            BlindBot::Constant(value) => action.0.clone_from(value),
            BlindBot::Uniform => action.0 = legal_uniform(&agent.actions, legal, &mut streams.action),
            BlindBot::Chaos => {
                action.0.clone_from(held.next(episode.tick, &agent.actions, legal, &mut streams.action));
            }
        }
    }
}

/// Returns a uniformly random action of a space.
pub fn uniform(space: &ActionSpace, rng: &mut impl rand::Rng) -> ActionValue {
    match space {
        ActionSpace::Discrete(n) => ActionValue::Discrete(rng.random_range(0..*n as u32)),
        ActionSpace::Continuous(n) => ActionValue::Continuous(uniform_numbers(*n, rng)),
        ActionSpace::Mixed(MixedSpace { choices, numbers }) => ActionValue::Mixed {
            choices: choices.sizes().iter().map(|&size| rng.random_range(0..size)).collect(),
            numbers: uniform_numbers(*numbers, rng),
        },
    }
}

fn uniform_numbers(count: usize, rng: &mut impl rand::Rng) -> Vec<f32> {
    (0..count).map(|_| rng.random_range(-1.0..=1.0)).collect()
}

/// Returns a uniformly random action of a space, among the legal ones.
pub fn legal_uniform(space: &ActionSpace, legal: Option<&LegalActions>, rng: &mut impl rand::Rng) -> ActionValue {
    let Some(legal) = legal else { return uniform(space, rng) };
    if let ActionSpace::Mixed(MixedSpace { choices, numbers }) = space {
        let drawn = (0..choices.sizes().len()).map(|choice| {
            let options = legal.options(choice);
            // Without a legal option it is a fault of this tick.
            options.get(rng.random_range(0..options.len().max(1))).copied().unwrap_or(0)
        });
        return ActionValue::Mixed { choices: drawn.collect(), numbers: uniform_numbers(*numbers, rng) };
    }
    if let ActionSpace::Continuous(numbers) = space {
        return ActionValue::Continuous(uniform_numbers(*numbers, rng));
    }
    // A mask without a legal action is a fault of this tick, so the action does not matter.
    let number = rng.random_range(0..legal.count().max(1) as u32);
    legal.pick(number).unwrap_or(ActionValue::Discrete(0))
}

/// Returns the planned action of a demonstrator with noise. For discrete actions, the noise is the probability of
/// replacing one by a uniformly random one, among the legal ones. For continuous ones, it is the standard deviation of
/// the normal noise on each value. Of several choices and numbers, each has its own noise. Zero noise draws no random number and keeps the action.
pub fn with_noise(
    planned: ActionValue,
    space: &ActionSpace,
    legal: Option<&LegalActions>,
    noise: f64,
    rng: &mut impl rand::Rng,
) -> ActionValue {
    match planned {
        ActionValue::Discrete(_) if noise > 0.0 && rng.random_bool(noise.min(1.0)) => legal_uniform(space, legal, rng),
        ActionValue::Continuous(values) if noise > 0.0 => {
            ActionValue::Continuous(values.into_iter().map(|value| noisy(value, noise, rng)).collect())
        }
        ActionValue::Mixed { choices, numbers } if noise > 0.0 => {
            let of_space = space.choices();
            let random = choices.into_iter().zip(of_space.sizes()).enumerate().map(|(at, (option, &size))| {
                if !rng.random_bool(noise.min(1.0)) {
                    return option;
                }
                let options = legal.map_or_else(|| (0..size).collect(), |legal| legal.options(at));
                options.get(rng.random_range(0..options.len().max(1))).copied().unwrap_or(option)
            });
            let choices = random.collect();
            ActionValue::Mixed { choices, numbers: numbers.into_iter().map(|value| noisy(value, noise, rng)).collect() }
        }
        planned => planned,
    }
}

fn noisy(value: f32, noise: f64, rng: &mut impl rand::Rng) -> f32 {
    (value + noise as f32 * normal(rng)).clamp(-1.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prelude::*;

    /// Returns the actions of chaos in episodes of this length.
    fn chaos(seed: u64, length: u32, ticks: usize) -> Vec<f32> {
        let mut app = headless_app();
        app.insert_resource(PlaybotSeed(seed));
        app.add_systems(FixedUpdate, move |mut episodes: Query<&mut Episode>| {
            episodes.iter_mut().filter(|episode| episode.tick + 1 == length).for_each(|mut it| it.terminate(false));
        });
        let agent = (Agent::new(0, ActionSpace::Continuous(1)), Control::Bot, BlindBot::Chaos);
        let agent = app.world_mut().spawn(agent).id();
        let mut next = || {
            app.tick().expect("no agent broke its contract");
            let action = app.world().get::<Action>(agent).and_then(Action::continuous);
            action.map_or(f32::NAN, |values| values[0])
        };
        (0..ticks).map(|_| next()).collect()
    }

    #[test]
    fn chaos_holds_each_action_for_one_to_thirty_ticks() {
        let actions = chaos(7, 10_000, 4000);
        let mut holds: Vec<usize> = actions.chunk_by(|one, other| one == other).map(<[f32]>::len).collect();
        // The last one may have been cut off.
        holds.pop();
        holds.sort_unstable();
        assert!(holds.len() > 200, "{}", holds.len());
        assert_eq!((holds.first(), holds.last()), (Some(&1), Some(&(LONGEST_HOLD as usize))));
        assert_eq!(actions, chaos(7, 10_000, 4000));
        assert_ne!(actions, chaos(8, 10_000, 4000));
    }

    #[test]
    fn chaos_begins_anew_in_every_episode() {
        let actions = chaos(7, 3, 300);
        let changes = (3..300).step_by(3).filter(|&start| actions[start] != actions[start - 1]).count();
        assert_eq!(changes, 99);
    }
}
