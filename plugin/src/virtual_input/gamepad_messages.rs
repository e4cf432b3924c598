//! Messages about gamepads: those of a driver, and those that Bevy's own system derives from them.

use bevy::{
    ecs::system::SystemParam,
    input::{
        ButtonState,
        gamepad::{
            AxisSettings, ButtonAxisSettings, GamepadAxisChangedEvent, GamepadButtonChangedEvent,
            GamepadButtonStateChangedEvent, GamepadConnectionEvent, GamepadEvent, RawGamepadAxisChangedEvent,
            RawGamepadButtonChangedEvent, RawGamepadEvent,
        },
    },
    prelude::*,
};

use super::{
    axis::VirtualAxis,
    button::VirtualButton,
    devices::{Change, Reading},
    input_state::Switch,
};

/// The writers of messages about gamepads.
#[derive(SystemParam)]
pub(super) struct GamepadMessages<'w, 's> {
    connections: MessageWriter<'w, GamepadConnectionEvent>,
    raw: MessageWriter<'w, RawGamepadEvent>,
    raw_buttons: MessageWriter<'w, RawGamepadButtonChangedEvent>,
    raw_axes: MessageWriter<'w, RawGamepadAxisChangedEvent>,
    processed: MessageWriter<'w, GamepadEvent>,
    buttons: MessageWriter<'w, GamepadButtonChangedEvent>,
    button_states: MessageWriter<'w, GamepadButtonStateChangedEvent>,
    axes: MessageWriter<'w, GamepadAxisChangedEvent>,
    settings: Query<'w, 's, &'static GamepadSettings>,
}

impl GamepadMessages<'_, '_> {
    /// Sends a message as a driver would: Bevy's own system reads it in its next run.
    pub fn send(&mut self, event: RawGamepadEvent) {
        self.send_part(&event);
        self.raw.write(event);
    }

    /// Sends the part of [`send`](Self::send) that Bevy's own system for buttons and sticks does not read.
    pub fn send_part(&mut self, event: &RawGamepadEvent) {
        match event {
            RawGamepadEvent::Connection(connection) => {
                self.connections.write(connection.clone());
            }
            RawGamepadEvent::Button(button) => {
                self.raw_buttons.write(*button);
            }
            RawGamepadEvent::Axis(axis) => {
                self.raw_axes.write(*axis);
            }
        }
    }

    /// Sends the derived messages as Bevy's own system would, with the state before and after the change. Small
    /// changes are sent too, because the state has them. A disconnected gamepad sends nothing.
    pub fn process(&mut self, event: &RawGamepadEvent, before: Reading, after: Reading) {
        match *event {
            RawGamepadEvent::Connection(_) => {}
            RawGamepadEvent::Button(RawGamepadButtonChangedEvent { gamepad, button, value }) => {
                let Ok(settings) = self.settings.get(gamepad) else { return };
                let state = if after.is_down { ButtonState::Pressed } else { ButtonState::Released };
                if before.is_down != after.is_down {
                    self.button_states.write(GamepadButtonStateChangedEvent::new(gamepad, button, state));
                }
                let value = scaled_button(settings.get_button_axis_settings(button), value);
                let event = GamepadButtonChangedEvent::new(gamepad, button, state, value);
                self.buttons.write(event);
                self.processed.write(event.into());
            }
            RawGamepadEvent::Axis(RawGamepadAxisChangedEvent { gamepad, axis, value }) => {
                let Ok(settings) = self.settings.get(gamepad) else { return };
                let value = scaled_axis(settings.get_axis_settings(axis), value);
                let event = GamepadAxisChangedEvent::new(gamepad, axis, value);
                self.axes.write(event);
                self.processed.write(event.into());
            }
        }
    }
}

/// Returns the driver's message for this change, if it is one of a gamepad.
pub(super) fn of_driver(change: Change) -> Option<RawGamepadEvent> {
    match change {
        Change::Button { switch: Switch { button: VirtualButton::Gamepad(button), pad: Some(pad) }, down } => {
            Some(RawGamepadButtonChangedEvent::new(pad, button, if down { 1.0 } else { 0.0 }).into())
        }
        Change::Axis { pad, axis: VirtualAxis::Trigger(button), value } => {
            Some(RawGamepadButtonChangedEvent::new(pad, button, value).into())
        }
        Change::Axis { pad, axis: VirtualAxis::Stick(axis), value } => {
            Some(RawGamepadAxisChangedEvent::new(pad, axis, value).into())
        }
        // Keys, mouse buttons and motions.
        Change::Button { .. } | Change::Axis { .. } => None,
    }
}

/// Scales a button's value to 0 to 1 between the values that count as untouched and fully pressed.
fn scaled_button(settings: &ButtonAxisSettings, value: f32) -> f32 {
    if value <= settings.low {
        0.0
    } else if value >= settings.high {
        1.0
    } else {
        (value - settings.low) / (settings.high - settings.low)
    }
}

/// Scales a stick's value to -1 to 1 between its dead zone and the values that count as fully pushed.
fn scaled_axis(settings: &AxisSettings, value: f32) -> f32 {
    let value = settings.clamp(value);
    if value > 0.0 {
        let (from, to) = (settings.deadzone_upperbound(), settings.livezone_upperbound());
        ((value - from) / (to - from)).min(1.0)
    } else if value < 0.0 {
        let (from, to) = (settings.livezone_lowerbound(), settings.deadzone_lowerbound());
        ((value - from) / (to - from) - 1.0).max(-1.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_scaled_as_bevy_scales_them() {
        let stick = AxisSettings::default();
        for (value, scaled) in [(0.0, 0.0), (0.05, 0.0), (0.525, 0.5), (1.0, 1.0), (-0.525, -0.5), (-1.0, -1.0)] {
            assert!((scaled_axis(&stick, value) - scaled).abs() < 1e-6, "{value}: {}", scaled_axis(&stick, value));
        }
        let button = ButtonAxisSettings::default();
        for (value, scaled) in [(0.0, 0.0), (0.05, 0.0), (0.5, 0.5), (0.96, 1.0), (1.0, 1.0)] {
            assert!(
                (scaled_button(&button, value) - scaled).abs() < 1e-6,
                "{value}: {}",
                scaled_button(&button, value)
            );
        }
    }
}
