//! What the agent of a foreign game does.

use bevy::prelude::*;

use super::runtime::{playing_agent, with_foreign};
use bevy_playbot::{action::ActionSpace, control::Control, key_bindings::KeyBindings, virtual_input::VirtualInput};

/// The way from an action into the game.
#[derive(Clone, Default)]
pub(super) struct Input {
    /// Keys, buttons and sticks.
    pub(super) pressed: Option<VirtualInput>,
    /// The keys of each discrete action, as far as the game is played with keys.
    pub(super) keys: Vec<Vec<KeyCode>>,
    /// For games that a system of their own hands actions to.
    pub(super) space: Option<ActionSpace>,
    /// Names of the actions.
    pub(super) names: Vec<String>,
}

impl Input {
    pub(super) fn space(&self) -> ActionSpace {
        let pressed = || self.pressed.as_ref().map(VirtualInput::space);
        self.space.or_else(pressed).unwrap_or(ActionSpace::Discrete(0))
    }

    /// Names as given, or those of the keys.
    pub(super) fn names(&self) -> Vec<String> {
        let of_keys = |keys: &Vec<KeyCode>| match keys.as_slice() {
            [] => "nothing".to_owned(),
            keys => keys.iter().map(|key| format!("{key:?}")).collect::<Vec<_>>().join("+"),
        };
        let is_of_keys = self.names.is_empty() && self.space() == ActionSpace::Discrete(self.keys.len());
        if is_of_keys { self.keys.iter().map(of_keys).collect() } else { self.names.clone() }
    }

    /// What a person's keys mean: for games that are played with nothing else.
    pub(super) fn bindings(&self) -> Option<KeyBindings> {
        let is_keys = self.space.is_none()
            && !self.keys.is_empty()
            && self.pressed == Some(VirtualInput::keys(self.keys.clone()));
        is_keys.then(|| KeyBindings::of_sets(&self.keys))
    }
}

/// Lets a game's own system hand the action on, for everybody but people, who have their own devices.
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
