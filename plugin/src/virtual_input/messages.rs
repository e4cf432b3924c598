//! Bevy's messages about keys, mouse and gamepads, as a window and a gamepad driver would send them.

use bevy::{
    ecs::system::SystemParam,
    input::{
        ButtonState,
        gamepad::{
            GamepadConnection, GamepadConnectionEvent, RawGamepadAxisChangedEvent, RawGamepadButtonChangedEvent,
            RawGamepadEvent,
        },
        keyboard::KeyboardInput,
        mouse::{MouseButtonInput, MouseMotion, MouseScrollUnit, MouseWheel},
        touch::TouchPhase,
    },
    prelude::*,
    window::PrimaryWindow,
};

use super::{axis::VirtualAxis, button::VirtualButton, devices::Change, input_state::Line, logical_key::logical_key};

/// Where messages go.
#[derive(SystemParam)]
pub(super) struct InputMessages<'w, 's> {
    keys: MessageWriter<'w, KeyboardInput>,
    mouse: MessageWriter<'w, MouseButtonInput>,
    motion: MessageWriter<'w, MouseMotion>,
    wheel: MessageWriter<'w, MouseWheel>,
    connections: MessageWriter<'w, GamepadConnectionEvent>,
    pads: MessageWriter<'w, RawGamepadEvent>,
    pad_buttons: MessageWriter<'w, RawGamepadButtonChangedEvent>,
    pad_axes: MessageWriter<'w, RawGamepadAxisChangedEvent>,
    windows: Query<'w, 's, Entity, With<PrimaryWindow>>,
}

impl InputMessages<'_, '_> {
    /// The window that messages say they come from; without a window, nobody.
    fn window(&self) -> Entity {
        self.windows.single().unwrap_or(Entity::PLACEHOLDER)
    }

    pub fn send(&mut self, change: Change) {
        match change {
            Change::Button { line, down } => self.send_button(line, down),
            Change::Axis { pad, axis: VirtualAxis::Stick(axis), value } => {
                let event = RawGamepadAxisChangedEvent::new(pad, axis, value);
                self.pad_axes.write(event);
                self.pads.write(event.into());
            }
            Change::Axis { pad, axis: VirtualAxis::Trigger(button), value } => {
                self.send_pad_button(pad, button, value);
            }
            // Motions are not held, so that they do not change.
            Change::Axis { .. } => {}
        }
    }

    fn send_button(&mut self, Line { button, pad }: Line, down: bool) {
        let (state, window) = (if down { ButtonState::Pressed } else { ButtonState::Released }, self.window());
        match button {
            VirtualButton::Key(key_code) => {
                let (logical_key, text) = logical_key(key_code);
                let text = text.filter(|_| down).map(|text| text.as_str().into());
                self.keys.write(KeyboardInput { key_code, logical_key, state, text, repeat: false, window });
            }
            VirtualButton::Mouse(button) => {
                self.mouse.write(MouseButtonInput { button, state, window });
            }
            VirtualButton::Gamepad(button) => {
                if let Some(pad) = pad {
                    self.send_pad_button(pad, button, if down { 1.0 } else { 0.0 });
                }
            }
        }
    }

    fn send_pad_button(&mut self, pad: Entity, button: GamepadButton, value: f32) {
        let event = RawGamepadButtonChangedEvent::new(pad, button, value);
        self.pad_buttons.write(event);
        self.pads.write(event.into());
    }

    /// Pixels to the right and downwards; lines of the wheel.
    pub fn send_motion(&mut self, delta: Vec2, wheel: Vec2) {
        if delta != Vec2::ZERO {
            self.motion.write(MouseMotion { delta });
        }
        if wheel != Vec2::ZERO {
            let (unit, window) = (MouseScrollUnit::Line, self.window());
            self.wheel.write(MouseWheel { unit, x: wheel.x, y: wheel.y, window, phase: TouchPhase::Moved });
        }
    }

    pub fn send_connection(&mut self, pad: Entity, name: String) {
        let connection = GamepadConnection::Connected { name, vendor_id: None, product_id: None };
        let event = GamepadConnectionEvent::new(pad, connection);
        self.connections.write(event.clone());
        self.pads.write(event.into());
    }
}
