//! What virtual input holds down, and what has to change.

use bevy::prelude::*;

use super::{axis::VirtualAxis, button::VirtualButton, input_state::Line};

/// What virtual input holds down at the moment, for all agents of the World.
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
    held: Vec<(Entity, Line)>,
    /// Sticks and triggers that are not at rest: agent, gamepad, what, value.
    pushed: Vec<Push>,
}

/// A stick or trigger of an agent's gamepad.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub(super) struct Push {
    pub agent: Entity,
    pub pad: Entity,
    pub axis: VirtualAxis,
    pub value: f32,
}

/// What all agents want in this tick.
#[derive(Debug, Default)]
pub(super) struct Wanted {
    pub lines: Vec<(Entity, Line)>,
    pub pushes: Vec<Push>,
    /// Pixels.
    pub motion: Vec2,
    /// Lines.
    pub wheel: Vec2,
}

/// A button that goes down or up, or a stick that moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Change {
    Button { line: Line, down: bool },
    Axis { pad: Entity, axis: VirtualAxis, value: f32 },
}

impl VirtualDevices {
    /// What is held: the agent, and its key or button.
    pub fn held(&self) -> impl Iterator<Item = (Entity, VirtualButton)> + '_ {
        self.held.iter().map(|(agent, line)| (*agent, line.button))
    }

    /// Goes from what is held to what is wanted. Releases come first. What is wanted and was let go of by something else,
    /// such as a window that lost the keyboard, is pressed again.
    pub(super) fn change(&mut self, wanted: &Wanted, is_down: impl Fn(Line) -> bool) -> Vec<Change> {
        let mut changes = self.release_unless(
            |held| wanted.lines.contains(held),
            |held| {
                wanted.pushes.iter().any(|push| (push.agent, push.pad, push.axis) == (held.agent, held.pad, held.axis))
            },
        );
        for &(agent, line) in &wanted.lines {
            let is_held = self.held.contains(&(agent, line));
            if !is_held {
                self.held.push((agent, line));
            }
            if !is_held || !is_down(line) {
                changes.push(Change::Button { line, down: true });
            }
        }
        for &push in &wanted.pushes {
            let same = |held: &&mut Push| (held.agent, held.pad, held.axis) == (push.agent, push.pad, push.axis);
            match self.pushed.iter_mut().find(same) {
                Some(held) if held.value.to_bits() == push.value.to_bits() => continue,
                Some(held) => held.value = push.value,
                None => self.pushed.push(push),
            }
            changes.push(Change::Axis { pad: push.pad, axis: push.axis, value: push.value });
        }
        changes
    }

    /// Lets go of everything that this agent holds.
    pub(super) fn release_agent(&mut self, agent: Entity) -> Vec<Change> {
        self.release_unless(|(holder, _)| *holder != agent, |push| push.agent != agent)
    }

    fn release_unless(
        &mut self,
        keep_button: impl Fn(&(Entity, Line)) -> bool,
        keep_push: impl Fn(&Push) -> bool,
    ) -> Vec<Change> {
        let mut changes = Vec::new();
        self.held.retain(|held| {
            let keep = keep_button(held);
            if !keep {
                changes.push(Change::Button { line: held.1, down: false });
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

    fn key(code: KeyCode) -> Line {
        Line { button: code.into(), pad: None }
    }

    fn button(line: Line, down: bool) -> Change {
        Change::Button { line, down }
    }

    #[test]
    fn held_keys_are_neither_pressed_twice_nor_released_early() {
        let agent = Entity::from_raw_u32(1).expect("a number");
        let (a, b) = (key(KeyCode::KeyA), key(KeyCode::KeyB));
        let mut devices = VirtualDevices::default();
        let mut change = |lines: &[Line], is_down: bool| {
            let lines = lines.iter().map(|&line| (agent, line)).collect();
            devices.change(&Wanted { lines, ..default() }, |_| is_down)
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
        devices.change(&Wanted { lines: vec![(one, a), (two, b)], pushes, ..default() }, |_| false);
        let released = devices.release_agent(one);
        assert_eq!(released, [button(a, false), Change::Axis { pad: two, axis, value: 0.0 }]);
        assert_eq!(devices.held().collect::<Vec<_>>(), [(two, b.button)]);
    }
}
