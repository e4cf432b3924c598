//! The mapping from an agent's actions to the inputs that they hold down.

use bevy::prelude::*;

use super::{action_axis::ActionAxis, button::VirtualButton, held::HeldInput};
use crate::action::{ActionSpace, ActionValue};

/// The inputs that each action of an agent holds down. It maps the agent's [`Action`](crate::action::Action) to the
/// input that a game reads from Bevy.
///
/// Discrete actions name a set of keys each, continuous ones an [`ActionAxis`] for each value.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_playbot::{prelude::*, virtual_input::{ActionAxis, VirtualInput}};
///
/// let walk = VirtualInput::keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]])
///     .mouse_buttons([vec![], vec![], vec![MouseButton::Left]]);
/// assert_eq!(walk.space(), ActionSpace::Discrete(3));
/// assert_eq!(walk.held(&ActionValue::Discrete(2)).buttons.len(), 2);
///
/// let fly = VirtualInput::axes([
///     ActionAxis::stick(GamepadAxis::LeftStickX),
///     ActionAxis::keys([KeyCode::KeyS], [KeyCode::KeyW]),
/// ]);
/// assert_eq!(fly.space(), ActionSpace::Continuous(2));
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component)]
pub struct VirtualInput {
    mapping: Mapping,
    /// True if sets of buttons were added to continuous actions, where they have no meaning.
    is_mixed: bool,
}

#[derive(Clone, Debug, PartialEq, Reflect)]
enum Mapping {
    /// The inputs that each discrete action holds.
    Discrete(Vec<HeldInput>),
    /// The inputs that each value of a continuous action moves.
    Continuous(Vec<ActionAxis>),
}

impl VirtualInput {
    /// Creates a mapping with a set of keys for each discrete action; an empty set presses nothing.
    pub fn keys(sets: impl IntoIterator<Item = impl IntoIterator<Item = KeyCode>>) -> Self {
        Self::discrete(sets.into_iter().map(HeldInput::new))
    }

    /// Creates a mapping with inputs of any device for each discrete action.
    pub fn discrete(actions: impl IntoIterator<Item = HeldInput>) -> Self {
        Self { mapping: Mapping::Discrete(actions.into_iter().collect()), is_mixed: false }
    }

    /// Creates a mapping with an axis for each value of a continuous action.
    pub fn axes(axes: impl IntoIterator<Item = ActionAxis>) -> Self {
        Self { mapping: Mapping::Continuous(axes.into_iter().collect()), is_mixed: false }
    }

    /// Adds a set of mouse buttons to each discrete action, in order. For continuous actions use
    /// [`ActionAxis::buttons`]; an agent with sets as well is a fault.
    pub fn mouse_buttons(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = MouseButton>>) -> Self {
        self.also(sets)
    }

    /// Adds a set of gamepad buttons to each discrete action, in order, as [`mouse_buttons`](Self::mouse_buttons) does.
    pub fn gamepad_buttons(self, sets: impl IntoIterator<Item = impl IntoIterator<Item = GamepadButton>>) -> Self {
        self.also(sets)
    }

    fn also<B: Into<VirtualButton>>(mut self, sets: impl IntoIterator<Item = impl IntoIterator<Item = B>>) -> Self {
        let Mapping::Discrete(actions) = &mut self.mapping else {
            self.is_mixed |= sets.into_iter().next().is_some();
            return self;
        };
        for (index, set) in sets.into_iter().enumerate() {
            if index == actions.len() {
                actions.push(HeldInput::default());
            }
            actions[index] = std::mem::take(&mut actions[index]).hold(set);
        }
        self
    }

    /// Returns the actions that it can express: as many as it names.
    pub fn space(&self) -> ActionSpace {
        match &self.mapping {
            Mapping::Discrete(actions) => ActionSpace::Discrete(actions.len()),
            Mapping::Continuous(axes) => ActionSpace::Continuous(axes.len()),
        }
    }

    /// Returns the inputs that this action holds down; empty for an action outside [`space`](Self::space).
    pub fn held(&self, action: &ActionValue) -> HeldInput {
        match (&self.mapping, action) {
            (Mapping::Discrete(actions), ActionValue::Discrete(index)) => {
                actions.get(*index as usize).cloned().unwrap_or_default()
            }
            (Mapping::Continuous(axes), ActionValue::Continuous(values)) => {
                axes.iter().zip(values).fold(HeldInput::default(), |held, (axis, &value)| axis.add_to(held, value))
            }
            _ => HeldInput::default(),
        }
    }

    /// Returns whether sets of buttons were added to continuous actions.
    pub(super) fn is_mixed(&self) -> bool {
        self.is_mixed
    }

    /// Returns all inputs that any of its actions may hold or move.
    pub(super) fn reach(&self) -> HeldInput {
        let join = |all: HeldInput, part: HeldInput| {
            let all = all.hold(part.buttons);
            part.axes.into_iter().fold(all, |all, (axis, _)| all.push(axis, 0.0))
        };
        match &self.mapping {
            Mapping::Discrete(actions) => actions.iter().cloned().fold(HeldInput::default(), join),
            Mapping::Continuous(axes) => axes.iter().map(ActionAxis::reach).fold(HeldInput::default(), join),
        }
    }

    /// Returns whether any of its actions uses the gamepad.
    pub(super) fn uses_gamepad(&self) -> bool {
        let reach = self.reach();
        let is_pad_button = |button: &VirtualButton| matches!(button, VirtualButton::Gamepad(_));
        reach.buttons.iter().any(is_pad_button) || reach.axes.iter().any(|(axis, _)| axis.is_gamepad())
    }
}

#[cfg(test)]
mod tests {
    use super::{super::axis::VirtualAxis, *};

    #[test]
    fn discrete_actions_hold_their_sets() {
        let input = VirtualInput::keys([vec![], vec![KeyCode::KeyA]])
            .mouse_buttons([vec![], vec![MouseButton::Left]])
            .gamepad_buttons([vec![], vec![], vec![GamepadButton::South]]);
        assert_eq!(input.space(), ActionSpace::Discrete(3));
        let held = |index| input.held(&ActionValue::Discrete(index)).buttons;
        assert!(held(0).is_empty() && held(9).is_empty());
        assert_eq!(held(1), [KeyCode::KeyA.into(), MouseButton::Left.into()]);
        assert_eq!(held(2), [GamepadButton::South.into()]);
        assert!(input.held(&ActionValue::Continuous(vec![1.0])).buttons.is_empty(), "of another kind");
        assert!(input.uses_gamepad());
    }

    #[test]
    fn values_press_beyond_their_threshold_and_push_by_their_scale() {
        let input = VirtualInput::axes([
            ActionAxis::keys([KeyCode::KeyA], [KeyCode::KeyD]).with_threshold(0.25),
            ActionAxis::mouse_x(8.0),
            ActionAxis::stick(GamepadAxis::LeftStickY),
            ActionAxis::trigger(GamepadButton::RightTrigger2),
        ]);
        let held = input.held(&ActionValue::Continuous(vec![-0.3, 0.5, 7.0, -1.0]));
        assert_eq!(held.buttons, [KeyCode::KeyA.into()]);
        let axes = [
            (VirtualAxis::MouseX, 4.0),
            (VirtualAxis::Stick(GamepadAxis::LeftStickY), 1.0),
            (VirtualAxis::Trigger(GamepadButton::RightTrigger2), 0.0),
        ];
        assert_eq!(held.axes, axes);
        assert!(input.held(&ActionValue::Continuous(vec![0.25, 0.0, 0.0, 0.0])).buttons.is_empty(), "not beyond it");
        assert_eq!(input.reach().buttons.len(), 2);
    }
}
