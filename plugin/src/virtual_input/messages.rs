//! Bevy's messages about keys, mouse and gamepads, as a window and a gamepad driver would send them.

use bevy::{
    ecs::system::SystemParam,
    input::{
        ButtonState,
        gamepad::{GamepadConnection, GamepadConnectionEvent},
        keyboard::KeyboardInput,
        mouse::{MouseButtonInput, MouseMotion, MouseScrollUnit, MouseWheel},
        touch::TouchPhase,
    },
    prelude::*,
    window::PrimaryWindow,
};

use super::{
    button::VirtualButton,
    devices::{Change, Reading},
    gamepad_messages::{GamepadMessages, of_driver},
    input_state::Switch,
    logical_key::logical_key,
};

/// The writers of messages.
#[derive(SystemParam)]
pub(super) struct InputMessages<'w, 's> {
    keys: MessageWriter<'w, KeyboardInput>,
    mouse: MessageWriter<'w, MouseButtonInput>,
    motion: MessageWriter<'w, MouseMotion>,
    wheel: MessageWriter<'w, MouseWheel>,
    pads: GamepadMessages<'w, 's>,
    windows: Query<'w, 's, Entity, With<PrimaryWindow>>,
}

impl InputMessages<'_, '_> {
    /// Returns the window that messages come from; a placeholder without a window.
    fn window(&self) -> Entity {
        self.windows.single().unwrap_or(Entity::PLACEHOLDER)
    }

    /// Sends a change as a window and a gamepad driver would. Bevy's own systems do the rest.
    pub fn send(&mut self, change: Change) {
        if let Some(event) = of_driver(change) {
            self.pads.send(event);
        } else if let Change::Button { switch, down } = change {
            self.send_button(switch, down);
        }
    }

    /// Sends the messages of a change that is already in the state, in its own tick, with the state before and after.
    ///
    /// Messages for keys and mouse affect only the state, which [`settle`](super::direct::settle) restores. A
    /// `RawGamepadEvent` is left out: Bevy's system for gamepads would read it in the next frame, when it may be
    /// outdated, and would press and announce everything again.
    pub fn tell(&mut self, change: Change, before: Reading, after: Reading) {
        match of_driver(change) {
            // A driver sends nothing about an unchanged value.
            Some(_) if before == after => {}
            Some(event) => {
                self.pads.send_part(&event);
                self.pads.process(&event, before, after);
            }
            None => self.send(change),
        }
    }

    /// Sends the messages of a change that is already in the state, where Bevy's own systems run later: the one for
    /// gamepads finds nothing changed.
    pub fn send_and_tell(&mut self, change: Change, before: Reading, after: Reading) {
        if let Some(event) = of_driver(change).filter(|_| before != after) {
            self.pads.process(&event, before, after);
        }
        self.send(change);
    }

    fn send_button(&mut self, Switch { button, .. }: Switch, down: bool) {
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
            // A call without a gamepad cannot reach this.
            VirtualButton::Gamepad(_) => {}
        }
    }

    /// Sends motion: pixels to the right and downwards, and lines of the wheel.
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
        self.pads.send(GamepadConnectionEvent::new(pad, connection).into());
    }
}
