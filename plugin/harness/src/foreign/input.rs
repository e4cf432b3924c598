//! The input of a foreign game's agent.

use crate::foreign::runtime::{playing_agent, with_foreign};
use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionSpace},
    agent::{Agent, Control},
    bot::with_noise,
    key_bindings::KeyBindings,
    streams::AgentStreams,
    virtual_input::{ActionAxis, HeldInput, UnknownInput, VirtualButton, VirtualInput},
};

/// The parts of the path from an action into the game, set in any order.
#[derive(Clone, Default)]
pub(super) struct Input {
    /// The keys of each discrete action, and other buttons that were set by name.
    pub(super) keys: Vec<Vec<VirtualButton>>,
    /// The first unknown name of a key, and its action.
    pub(super) unknown_key: Option<(usize, UnknownInput)>,
    /// The mouse buttons of each discrete action.
    pub(super) mouse: Vec<Vec<MouseButton>>,
    /// The gamepad buttons of each discrete action.
    pub(super) pads: Vec<Vec<GamepadButton>>,
    /// The axis that each value of a continuous action moves.
    pub(super) axes: Option<Vec<ActionAxis>>,
    /// The complete input, if it was set as a whole.
    pub(super) whole: Option<VirtualInput>,
    /// The actions of games with a system of their own for them.
    pub(super) space: Option<ActionSpace>,
    /// Names of the actions.
    pub(super) names: Vec<String>,
}

impl Input {
    /// Sets the keys of each action.
    pub(super) fn set_keys(&mut self, sets: impl IntoIterator<Item = impl IntoIterator<Item = KeyCode>>) {
        self.keys = sets.into_iter().map(|set| set.into_iter().map(VirtualButton::Key).collect()).collect();
        self.unknown_key = None;
    }

    /// Sets the keys of each action by their names. An unknown name becomes the [`problem`](Self::problem).
    pub(super) fn name_keys(&mut self, sets: impl IntoIterator<Item = impl IntoIterator<Item = impl AsRef<str>>>) {
        (self.keys, self.unknown_key) = (Vec::new(), None);
        for (action, names) in sets.into_iter().enumerate() {
            let mut keys = Vec::new();
            for name in names {
                match name.as_ref().parse::<VirtualButton>() {
                    Ok(key) => keys.push(key),
                    Err(unknown) => {
                        self.unknown_key.get_or_insert((action, unknown));
                    }
                }
            }
            self.keys.push(keys);
        }
    }

    pub(super) fn space(&self) -> ActionSpace {
        let pressed = || self.pressed().map(|pressed| pressed.space());
        self.space.or_else(pressed).unwrap_or(ActionSpace::Discrete(0))
    }

    /// Returns the input that the parts press together; `None` for a game in which nothing is pressed.
    pub(super) fn pressed(&self) -> Option<VirtualInput> {
        let is_discrete = !(self.keys.is_empty() && self.mouse.is_empty() && self.pads.is_empty());
        let base = match (&self.whole, &self.axes) {
            (Some(whole), _) => whole.clone(),
            (None, Some(axes)) => VirtualInput::axes(axes.iter().cloned()),
            (None, None) if is_discrete => VirtualInput::discrete(self.keys.iter().cloned().map(HeldInput::new)),
            (None, None) => return None,
        };
        match base.space() {
            ActionSpace::Discrete(_) => Some(base.mouse_buttons(self.mouse.clone()).gamepad_buttons(self.pads.clone())),
            ActionSpace::Continuous(_) => Some(base),
        }
    }

    /// Returns the problem of the input: an unknown key, or parts that contradict each other. The text follows the name
    /// of the game.
    pub(super) fn problem(&self) -> Option<String> {
        if let Some((action, unknown)) = &self.unknown_key {
            return Some(format!("names a key that does not exist, in action {action}: {unknown}"));
        }
        let said =
            [("`.keys`", !self.keys.is_empty()), ("`.axes`", self.axes.is_some()), ("`.input`", self.whole.is_some())];
        let said: Vec<&str> = said.into_iter().filter_map(|(name, is_said)| is_said.then_some(name)).collect();
        if said.len() > 1 {
            return Some(format!("has {}, and each of them declares every action: keep one", said.join(" and ")));
        }
        let buttons = if self.mouse.is_empty() { "`.gamepad_buttons`" } else { "`.mouse_buttons`" };
        let has_buttons = !(self.mouse.is_empty() && self.pads.is_empty());
        let is_continuous = matches!(self.pressed()?.space(), ActionSpace::Continuous(_));
        (has_buttons && is_continuous).then(|| {
            format!(
                "has {buttons}, which belong to discrete actions, and continuous ones: buttons of these are \
                 `ActionAxis::buttons` in `.axes`"
            )
        })
    }

    /// Returns the names that were set, or those of the keys.
    pub(super) fn names(&self) -> Vec<String> {
        let of_keys = |keys: &Vec<VirtualButton>| match keys.as_slice() {
            [] => "nothing".to_owned(),
            keys => keys.iter().map(VirtualButton::to_string).collect::<Vec<_>>().join("+"),
        };
        let is_of_keys = self.names.is_empty() && self.space() == ActionSpace::Discrete(self.keys.len());
        if is_of_keys { self.keys.iter().map(of_keys).collect() } else { self.names.clone() }
    }

    /// Returns the keys of a person: for games that are played with keys alone.
    pub(super) fn bindings(&self) -> Option<KeyBindings> {
        let key = |button: &VirtualButton| match button {
            VirtualButton::Key(key) => Some(*key),
            VirtualButton::Mouse(_) | VirtualButton::Gamepad(_) => None,
        };
        let sets = self.keys.iter().map(|set| set.iter().map(key).collect::<Option<Vec<KeyCode>>>());
        let sets: Vec<Vec<KeyCode>> = sets.collect::<Option<_>>()?;
        let is_keys = self.space.is_none()
            && !sets.is_empty()
            && self.pressed() == Some(VirtualInput::keys(sets.iter().cloned()));
        is_keys.then(|| KeyBindings::of_sets(&sets))
    }
}

/// Lets the game's own system pass the action on, except for people, who have their own devices.
pub(super) fn act(world: &mut World) {
    let Some(agent) = playing_agent(world) else { return };
    if world.get(agent) == Some(&Control::Human) {
        return;
    }
    with_foreign(world, agent, |world, foreign| match &mut foreign.act {
        Some(system) => system.demand(world),
        None => Ok(()),
    });
}

/// Marks an agent that the game's demonstrator plays while its control is [`Control::Bot`].
#[derive(Component, Clone, Copy, Debug, Reflect)]
#[reflect(Component)]
pub(super) struct ForeignBot {
    /// Probability of a random action, or standard deviation of the noise.
    pub(super) noise: f64,
}

pub(super) fn decide(world: &mut World) {
    let Some(agent) = playing_agent(world) else { return };
    let (Some(&ForeignBot { noise }), Some(Control::Bot)) = (world.get(agent), world.get::<Control>(agent)) else {
        return;
    };
    let planned = with_foreign(world, agent, |world, foreign| match &mut foreign.bot {
        Some(bot) => bot.demand(world),
        None => Err("it has no demonstrator".to_owned()),
    });
    let Some(planned) = planned else { return };
    let mut entity = world.entity_mut(agent);
    let Some(space) = entity.get::<Agent>().map(|agent| agent.actions) else { return };
    let Some(mut streams) = entity.get_mut::<AgentStreams>() else { return };
    let chosen = with_noise(planned, &space, noise, &mut streams.action);
    entity.insert(Action(chosen));
}
