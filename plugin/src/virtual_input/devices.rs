//! The inputs that virtual input holds down, and their changes.

use bevy::prelude::*;

use super::{
    axis::VirtualAxis,
    button::VirtualButton,
    input_state::{InputState, Switch},
};

/// The inputs that virtual input holds down now, for all agents of the World.
///
/// ```
/// use bevy::{input::InputPlugin, prelude::*};
/// use bevy_playbot::{prelude::*, virtual_input::{VirtualDevices, VirtualInputPlugin}};
///
/// let mut app = headless_app();
/// app.add_plugins((InputPlugin, VirtualInputPlugin::default()));
/// assert_eq!(app.world().resource::<VirtualDevices>().held().count(), 0);
/// ```
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(Resource)]
pub struct VirtualDevices {
    held: Vec<(Entity, Switch)>,
    /// Sticks and triggers that are not at rest.
    pushed: Vec<Push>,
}

/// A stick or trigger of an agent's gamepad, with its value.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub(super) struct Push {
    pub agent: Entity,
    pub pad: Entity,
    pub axis: VirtualAxis,
    pub value: f32,
}

impl Push {
    /// Returns whether both push the same stick or trigger, however far.
    fn is_of_same(&self, other: &Self) -> bool {
        (self.agent, self.pad, self.axis) == (other.agent, other.pad, other.axis)
    }
}

/// The inputs that all agents hold in this tick.
#[derive(Debug, Default)]
pub(super) struct Wanted {
    pub switches: Vec<(Entity, Switch)>,
    pub pushes: Vec<Push>,
    /// Motion of the mouse, pixels.
    pub motion: Vec2,
    /// Motion of the wheel, lines.
    pub wheel: Vec2,
}

/// A button that goes down or up, or a stick that moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Change {
    Button { switch: Switch, down: bool },
    Axis { pad: Entity, axis: VirtualAxis, value: f32 },
}

/// The state of a button or stick as games see it. A trigger is both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading {
    pub is_down: bool,
    /// Value of a stick or trigger; 0 for keys and mouse buttons.
    pub value: f32,
}

impl Change {
    /// Returns the state as games see it now.
    pub fn read(self, state: &InputState) -> Reading {
        match self {
            Self::Button { switch, .. } => Reading { is_down: state.is_down(switch), value: state.value(switch) },
            Self::Axis { pad, axis: VirtualAxis::Trigger(button), .. } => {
                let switch = Switch { button: VirtualButton::Gamepad(button), pad: Some(pad) };
                Reading { is_down: state.is_down(switch), value: state.value(switch) }
            }
            Self::Axis { pad, axis: VirtualAxis::Stick(axis), .. } => {
                Reading { is_down: false, value: state.stick(pad, axis) }
            }
            // Motions are not held.
            Self::Axis { .. } => Reading { is_down: false, value: 0.0 },
        }
    }
}

impl VirtualDevices {
    /// Returns the held inputs: the agent, and its key or button.
    pub fn held(&self) -> impl Iterator<Item = (Entity, VirtualButton)> + '_ {
        self.held.iter().map(|(agent, switch)| (*agent, switch.button))
    }

    /// Changes the held inputs to the wanted ones. Releases come first. A wanted input that was released by something
    /// else, such as a window that lost the keyboard, is pressed again.
    pub(super) fn change(&mut self, wanted: &Wanted, is_down: impl Fn(Switch) -> bool) -> Vec<Change> {
        let mut changes = self.release_unless(
            |held| wanted.switches.contains(held),
            |held| wanted.pushes.iter().any(|push| push.is_of_same(held)),
        );
        for &(agent, switch) in &wanted.switches {
            let is_held = self.held.contains(&(agent, switch));
            if !is_held {
                self.held.push((agent, switch));
            }
            if !is_held || !is_down(switch) {
                changes.push(Change::Button { switch, down: true });
            }
        }
        for &push in &wanted.pushes {
            match self.pushed.iter_mut().find(|held| held.is_of_same(&push)) {
                Some(held) if held.value.to_bits() == push.value.to_bits() => continue,
                Some(held) => held.value = push.value,
                None => self.pushed.push(push),
            }
            changes.push(Change::Axis { pad: push.pad, axis: push.axis, value: push.value });
        }
        changes
    }

    /// Releases all inputs of this agent.
    pub(super) fn release_agent(&mut self, agent: Entity) -> Vec<Change> {
        self.release_unless(|(holder, _)| *holder != agent, |push| push.agent != agent)
    }

    fn release_unless(
        &mut self,
        keep_button: impl Fn(&(Entity, Switch)) -> bool,
        keep_push: impl Fn(&Push) -> bool,
    ) -> Vec<Change> {
        let mut changes = Vec::new();
        self.held.retain(|held| {
            let keep = keep_button(held);
            if !keep {
                changes.push(Change::Button { switch: held.1, down: false });
            }
            keep
        });
        self.pushed.retain(|push| {
            let keep = keep_push(push);
            if !keep {
                changes.push(Change::Axis { pad: push.pad, axis: push.axis, value: 0.0 });
            }
            keep
        });
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(code: KeyCode) -> Switch {
        Switch { button: code.into(), pad: None }
    }

    fn button(switch: Switch, down: bool) -> Change {
        Change::Button { switch, down }
    }

    #[test]
    fn held_keys_are_neither_pressed_twice_nor_released_early() {
        let agent = Entity::from_raw_u32(1).expect("a number");
        let (a, b) = (key(KeyCode::KeyA), key(KeyCode::KeyB));
        let mut devices = VirtualDevices::default();
        let mut change = |switches: &[Switch], is_down: bool| {
            let switches = switches.iter().map(|&switch| (agent, switch)).collect();
            devices.change(&Wanted { switches, ..default() }, |_| is_down)
        };
        assert_eq!(change(&[a], false), [button(a, true)]);
        assert_eq!(change(&[a], true), []);
        assert_eq!(change(&[a], false), [button(a, true)], "something else let go of it");
        assert_eq!(change(&[b], true), [button(a, false), button(b, true)]);
        assert_eq!(change(&[], true), [button(b, false)]);
    }

    #[test]
    fn an_agent_lets_go_of_its_own_things_only() {
        let [one, two] = [1, 2].map(|number| Entity::from_raw_u32(number).expect("a number"));
        let (a, b) = (key(KeyCode::KeyA), key(KeyCode::KeyB));
        let axis = VirtualAxis::Stick(GamepadAxis::LeftStickX);
        let pushes = vec![Push { agent: one, pad: two, axis, value: 0.5 }];
        let mut devices = VirtualDevices::default();
        devices.change(&Wanted { switches: vec![(one, a), (two, b)], pushes, ..default() }, |_| false);
        let released = devices.release_agent(one);
        assert_eq!(released, [button(a, false), Change::Axis { pad: two, axis, value: 0.0 }]);
        assert_eq!(devices.held().collect::<Vec<_>>(), [(two, b.button)]);
    }
}
