//! The inputs that virtual input holds down, and their changes.

use crate::virtual_input::{
    button::{VirtualAxis, VirtualButton},
    input_state::{InputState, Switch},
    pointer::{Cursor, Finger, PointerPosition},
};
use bevy::prelude::*;

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
    /// The mouse cursor, if an agent has moved it.
    pub(super) cursor: Option<Cursor>,
    /// The finger that is down on the touch screen.
    pub(super) finger: Option<Finger>,
    /// Number of the next finger. Bevy needs a new one for each touch.
    pub(super) next_finger: u64,
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
    /// Agents that play in this tick.
    pub agents: Vec<Entity>,
    /// Mouse buttons that are pressed anew, even if they are down.
    pub anew: Vec<(Entity, Switch)>,
    /// The agent that moves the mouse cursor, and the position.
    pub cursor: Option<(Entity, PointerPosition)>,
    /// The agent that taps on the touch screen, and the position.
    pub tap: Option<(Entity, PointerPosition)>,
    /// The text that agents type.
    pub text: String,
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
            let is_anew = is_held && wanted.anew.contains(&(agent, switch));
            if is_anew {
                changes.push(Change::Button { switch, down: false });
            }
            if !is_held || is_anew || !is_down(switch) {
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

/// The inputs that are held down and pushed while one action lasts.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_playbot::virtual_input::{HeldInput, VirtualAxis};
///
/// // Run to the right and look up.
/// let held = HeldInput::new([KeyCode::ShiftLeft, KeyCode::KeyD]).push(VirtualAxis::MouseY, -4.0);
/// assert_eq!(held.buttons.len(), 2);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct HeldInput {
    /// Keys and buttons that are down.
    pub buttons: Vec<VirtualButton>,
    /// Motions and sticks, with their values.
    pub axes: Vec<(VirtualAxis, f32)>,
    /// Position of the mouse cursor, which stays there until another action moves it.
    pub cursor: Option<PointerPosition>,
    /// Position of a tap on the touch screen. A finger is down during the tick, and each tick is a tap of its own.
    pub tap: Option<PointerPosition>,
    /// True if mouse buttons are pressed anew in each tick, as clicks. Otherwise they stay down from tick to tick.
    pub clicks: bool,
    /// Text that is typed in each tick: see [`types`](Self::types).
    pub text: String,
}

impl HeldInput {
    /// Creates a set of these keys or buttons only.
    pub fn new<B: Into<VirtualButton>>(buttons: impl IntoIterator<Item = B>) -> Self {
        Self::default().hold(buttons)
    }

    /// Adds these keys or buttons.
    pub fn hold<B: Into<VirtualButton>>(mut self, buttons: impl IntoIterator<Item = B>) -> Self {
        for button in buttons {
            let button = button.into();
            if !self.buttons.contains(&button) {
                self.buttons.push(button);
            }
        }
        self
    }

    /// Adds what another option holds at the same time.
    pub(super) fn and(self, other: &Self) -> Self {
        let all = Self {
            cursor: other.cursor.or(self.cursor),
            tap: other.tap.or(self.tap),
            clicks: self.clicks || other.clicks,
            text: format!("{}{}", self.text, other.text),
            ..self
        };
        let all = all.hold(other.buttons.iter().copied());
        other.axes.iter().fold(all, |all, &(axis, value)| all.push(axis, value))
    }

    /// Moves the mouse cursor to this position.
    pub fn at(mut self, position: PointerPosition) -> Self {
        self.cursor = Some(position);
        self
    }

    /// Moves the mouse cursor to this position and clicks there: the button is pressed anew in each tick that takes the
    /// action.
    pub fn click(self, position: PointerPosition, button: MouseButton) -> Self {
        Self { clicks: true, ..self.at(position).hold([button]) }
    }

    /// Taps on the touch screen at this position.
    pub fn tap(mut self, position: PointerPosition) -> Self {
        self.tap = Some(position);
        self
    }

    /// Types this text: in each tick of the action, each of its characters goes down and up. Games that read text from
    /// `KeyboardInput` see it; so do those that read logical keys. A line feed is the Enter key.
    pub fn types(mut self, text: impl Into<String>) -> Self {
        self.text = text.into();
        self
    }

    /// Adds a motion or stick; a second push of the same one is added to the first.
    pub fn push(mut self, axis: impl Into<VirtualAxis>, value: f32) -> Self {
        let axis = axis.into();
        match self.axes.iter_mut().find(|(pushed, _)| *pushed == axis) {
            Some((_, pushed)) => *pushed += value,
            None => self.axes.push((axis, value)),
        }
        self
    }
}

/// Default threshold beyond which values press their key.
const THRESHOLD: f32 = 0.5;

/// The effect of one value of a continuous action.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub enum ActionAxis {
    /// Keys or buttons for each sign, pressed while the value lies beyond the threshold.
    Buttons {
        /// Held below `-threshold`.
        negative: Vec<VirtualButton>,
        /// Held above `threshold`.
        positive: Vec<VirtualButton>,
        /// Magnitude that a value must exceed.
        threshold: f32,
    },
    /// A motion or a stick, pushed by the value.
    Analog {
        /// The pushed axis.
        axis: VirtualAxis,
        /// Factor from the value to the axis, such as pixels per tick.
        scale: f32,
    },
}

impl ActionAxis {
    /// Creates an axis with keys or buttons for each sign of the value: left and right, brake and throttle. They are
    /// pressed beyond ±0.5.
    pub fn buttons<N: Into<VirtualButton>, P: Into<VirtualButton>>(
        negative: impl IntoIterator<Item = N>,
        positive: impl IntoIterator<Item = P>,
    ) -> Self {
        Self::Buttons {
            negative: negative.into_iter().map(Into::into).collect(),
            positive: positive.into_iter().map(Into::into).collect(),
            threshold: THRESHOLD,
        }
    }

    /// Keys for each sign of the value.
    pub fn keys(negative: impl IntoIterator<Item = KeyCode>, positive: impl IntoIterator<Item = KeyCode>) -> Self {
        Self::buttons(negative, positive)
    }

    /// Sets another threshold for the keys. Has no effect on sticks and motions.
    pub fn with_threshold(self, threshold: f32) -> Self {
        match self {
            Self::Buttons { negative, positive, .. } => Self::Buttons { negative, positive, threshold },
            analog => analog,
        }
    }

    /// Creates a stick of the gamepad: the value, limited to -1 to 1.
    pub fn stick(axis: GamepadAxis) -> Self {
        Self::Analog { axis: VirtualAxis::Stick(axis), scale: 1.0 }
    }

    /// Creates a trigger of the gamepad: the value, limited to 0 to 1.
    pub fn trigger(button: GamepadButton) -> Self {
        Self::Analog { axis: VirtualAxis::Trigger(button), scale: 1.0 }
    }

    /// Moves the mouse to the right by `pixels` per tick for a value of 1.
    pub fn mouse_x(pixels: f32) -> Self {
        Self::Analog { axis: VirtualAxis::MouseX, scale: pixels }
    }

    /// Moves the mouse downwards by `pixels` per tick for a value of 1.
    pub fn mouse_y(pixels: f32) -> Self {
        Self::Analog { axis: VirtualAxis::MouseY, scale: pixels }
    }

    /// Turns the mouse wheel by `lines` per tick for a value of 1.
    pub fn wheel(lines: f32) -> Self {
        Self::Analog { axis: VirtualAxis::WheelY, scale: lines }
    }

    /// Adds the inputs that this value holds.
    pub(super) fn add_to(&self, held: HeldInput, value: f32) -> HeldInput {
        match self {
            Self::Buttons { positive, threshold, .. } if value > *threshold => held.hold(positive.iter().copied()),
            Self::Buttons { negative, threshold, .. } if value < -threshold => held.hold(negative.iter().copied()),
            Self::Buttons { .. } => held,
            Self::Analog { axis: axis @ VirtualAxis::Stick(_), scale } => {
                held.push(*axis, (value * scale).clamp(-1.0, 1.0))
            }
            Self::Analog { axis: axis @ VirtualAxis::Trigger(_), scale } => {
                held.push(*axis, (value * scale).clamp(0.0, 1.0))
            }
            Self::Analog { axis, scale } => held.push(*axis, value * scale),
        }
    }

    /// Returns all keys, buttons and axes that it may move.
    pub(super) fn reach(&self) -> HeldInput {
        match self {
            Self::Buttons { negative, positive, .. } => HeldInput::new(negative.iter().chain(positive).copied()),
            Self::Analog { axis, .. } => HeldInput::default().push(*axis, 0.0),
        }
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
    fn a_click_presses_its_button_anew_in_each_tick() {
        let agent = Entity::from_raw_u32(1).expect("a number");
        let left = Switch { button: MouseButton::Left.into(), pad: None };
        let mut devices = VirtualDevices::default();
        let mut change = |anew: Vec<(Entity, Switch)>| {
            devices.change(&Wanted { switches: vec![(agent, left)], anew, ..default() }, |_| true)
        };
        assert_eq!(change(vec![(agent, left)]), [button(left, true)]);
        assert_eq!(change(vec![(agent, left)]), [button(left, false), button(left, true)]);
        assert_eq!(change(vec![]), [], "held from the click on");
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
