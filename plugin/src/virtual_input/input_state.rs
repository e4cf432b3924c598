//! Bevy's own state of keys, mouse and gamepads.

use crate::virtual_input::button::{VirtualAxis, VirtualButton, unit_names, unit_variant};
use bevy::{
    ecs::system::SystemParam,
    input::{
        gamepad::GamepadInput,
        keyboard::{Key, NativeKey, NativeKeyCode},
        mouse::{AccumulatedMouseMotion, AccumulatedMouseScroll},
    },
    prelude::*,
};
use std::hash::Hash;

/// Values at which a gamepad's trigger counts as pressed (above the first) and released (below the second): Bevy's
/// defaults.
const TRIGGER: (f32, f32) = (0.75, 0.65);

/// A key or button of one device; `pad` names the gamepad, if it is a gamepad's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
pub(super) struct Switch {
    pub button: VirtualButton,
    pub pad: Option<Entity>,
}

/// A change of a button.
#[derive(Clone, Copy)]
pub(super) enum Touch {
    Press,
    Release,
    /// Up, as if it had never been pressed.
    Reset,
    /// Neither just pressed nor just released.
    Settle,
    /// Just pressed, just released, or both, whatever its state is.
    Flag {
        pressed: bool,
        released: bool,
    },
}

/// The input state that games read.
#[derive(SystemParam)]
pub(super) struct InputState<'w, 's> {
    keys: ResMut<'w, ButtonInput<KeyCode>>,
    logical: ResMut<'w, ButtonInput<Key>>,
    mouse: ResMut<'w, ButtonInput<MouseButton>>,
    pub motion: ResMut<'w, AccumulatedMouseMotion>,
    pub scroll: ResMut<'w, AccumulatedMouseScroll>,
    pads: Query<'w, 's, &'static mut Gamepad>,
}

impl InputState<'_, '_> {
    /// Returns whether the game sees it down.
    pub fn is_down(&self, switch: Switch) -> bool {
        match switch.button {
            VirtualButton::Key(key) => self.keys.pressed(key),
            VirtualButton::Mouse(button) => self.mouse.pressed(button),
            VirtualButton::Gamepad(button) => {
                switch.pad.and_then(|pad| self.pads.get(pad).ok()).is_some_and(|pad| pad.pressed(button))
            }
        }
    }

    /// Returns the value of a gamepad's button; 0 for others.
    pub fn value(&self, switch: Switch) -> f32 {
        match switch {
            Switch { button: VirtualButton::Gamepad(button), pad: Some(pad) } => self.analog(pad, button),
            _ => 0.0,
        }
    }

    /// Returns the value of a stick.
    pub fn stick(&self, pad: Entity, axis: GamepadAxis) -> f32 {
        self.analog(pad, axis)
    }

    fn analog(&self, pad: Entity, input: impl Into<GamepadInput>) -> f32 {
        self.pads.get(pad).ok().and_then(|pad| pad.get_unclamped(input)).unwrap_or(0.0)
    }

    /// Returns whether this entity is a gamepad that is connected.
    pub fn is_connected(&self, pad: Entity) -> bool {
        self.pads.contains(pad)
    }

    pub fn touch(&mut self, switch: Switch, touch: Touch) {
        match switch.button {
            VirtualButton::Key(key) => {
                apply(&mut self.keys, key, touch);
                apply(&mut self.logical, logical_key(key).0, touch);
            }
            VirtualButton::Mouse(button) => apply(&mut self.mouse, button, touch),
            VirtualButton::Gamepad(button) => {
                let Some(mut pad) = switch.pad.and_then(|pad| self.pads.get_mut(pad).ok()) else { return };
                apply(pad.digital_mut(), button, touch);
                match touch {
                    Touch::Press => {
                        pad.analog_mut().set(button, 1.0);
                    }
                    Touch::Release | Touch::Reset => {
                        pad.analog_mut().set(button, 0.0);
                    }
                    Touch::Settle | Touch::Flag { .. } => {}
                }
            }
        }
    }

    /// Sets a stick or trigger of a gamepad. Returns the trigger as a button if that went down or up.
    pub fn set_axis(&mut self, pad: Entity, axis: VirtualAxis, value: f32) -> Option<(Switch, bool)> {
        let mut gamepad = self.pads.get_mut(pad).ok()?;
        match axis {
            VirtualAxis::Stick(axis) => {
                gamepad.analog_mut().set(axis, value);
            }
            VirtualAxis::Trigger(button) => {
                gamepad.analog_mut().set(button, value);
                let was_down = gamepad.pressed(button);
                let switch = Switch { button: VirtualButton::Gamepad(button), pad: Some(pad) };
                if !was_down && value >= TRIGGER.0 {
                    gamepad.digital_mut().press(button);
                    return Some((switch, true));
                }
                if was_down && value <= TRIGGER.1 {
                    gamepad.digital_mut().release(button);
                    return Some((switch, false));
                }
            }
            _ => {}
        }
        None
    }
}

fn apply<T: Clone + Eq + Hash + Send + Sync + 'static>(input: &mut ButtonInput<T>, button: T, touch: Touch) {
    match touch {
        Touch::Press => input.press(button),
        Touch::Release => input.release(button),
        Touch::Reset => input.reset(button),
        Touch::Settle => {
            input.clear_just_pressed(button.clone());
            input.clear_just_released(button);
        }
        Touch::Flag { pressed, released } => {
            // The two marks can be set only by moving the button there and back.
            if input.pressed(button.clone()) {
                input.release(button.clone());
                input.press(button.clone());
            } else {
                input.press(button.clone());
                input.release(button.clone());
            }
            if !pressed {
                input.clear_just_pressed(button.clone());
            }
            if !released {
                input.clear_just_released(button);
            }
        }
    }
}

/// Returns the meaning of a key, and the text that it types.
pub(super) fn logical_key(code: KeyCode) -> (Key, Option<String>) {
    let name = format!("{code:?}");
    if let Some(character) = typed(&name) {
        // Bevy names the space bar, although it types a space.
        let key = if character == " " { Key::Space } else { Key::Character(character.as_str().into()) };
        return (key, Some(character));
    }
    let plain = name.strip_prefix("Numpad").unwrap_or(&name);
    let plain = plain.strip_suffix("Left").or(plain.strip_suffix("Right")).unwrap_or(plain);
    // Arrow keys have the same name in both enums; other names include a side.
    let key = unit_variant(&name).or_else(|| unit_variant(plain));
    (key.unwrap_or(Key::Unidentified(NativeKey::Unidentified)), None)
}

/// Returns the key that types this character on an American keyboard, its meaning, and the text of its message.
/// Characters that no key has there have a meaning only.
pub(super) fn typing_key(character: char) -> (KeyCode, Key, Option<String>) {
    let named = match character {
        '\n' => Some((KeyCode::Enter, Key::Enter)),
        '\t' => Some((KeyCode::Tab, Key::Tab)),
        '\u{8}' => Some((KeyCode::Backspace, Key::Backspace)),
        _ => None,
    };
    if let Some((code, key)) = named {
        return (code, key, None);
    }
    let text = character.to_string();
    let plain = text.to_ascii_lowercase();
    let code = unit_names::<KeyCode>().into_iter().find(|name| typed(name).as_deref() == Some(plain.as_str()));
    let code = code.and_then(unit_variant).unwrap_or(KeyCode::Unidentified(NativeKeyCode::Unidentified));
    let key = if character == ' ' { Key::Space } else { Key::Character(text.as_str().into()) };
    (code, key, Some(text))
}

/// Returns the text that a key types without shift.
fn typed(name: &str) -> Option<String> {
    let text = match name {
        "Space" => " ",
        "Backquote" => "`",
        "Backslash" | "IntlBackslash" => "\\",
        "BracketLeft" => "[",
        "BracketRight" => "]",
        "Comma" | "NumpadComma" => ",",
        "Equal" | "NumpadEqual" => "=",
        "Minus" | "NumpadSubtract" => "-",
        "Period" | "NumpadDecimal" => ".",
        "Quote" => "'",
        "Semicolon" => ";",
        "Slash" | "NumpadDivide" => "/",
        "NumpadAdd" => "+",
        "NumpadMultiply" | "NumpadStar" => "*",
        _ => {
            let letter = name.strip_prefix("Key").filter(|rest| rest.len() == 1);
            let digit = name.strip_prefix("Digit").or(name.strip_prefix("Numpad")).filter(|rest| rest.len() == 1);
            return letter.or(digit).map(str::to_ascii_lowercase);
        }
    };
    Some(text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_mean_what_they_mean_on_a_us_keyboard() {
        for (code, key, text) in [
            (KeyCode::KeyW, Key::Character("w".into()), Some("w")),
            (KeyCode::Digit7, Key::Character("7".into()), Some("7")),
            (KeyCode::Numpad7, Key::Character("7".into()), Some("7")),
            (KeyCode::Space, Key::Space, Some(" ")),
            (KeyCode::ArrowLeft, Key::ArrowLeft, None),
            (KeyCode::ShiftRight, Key::Shift, None),
            (KeyCode::NumpadEnter, Key::Enter, None),
            (KeyCode::F9, Key::F9, None),
            (KeyCode::Lang5, Key::Unidentified(NativeKey::Unidentified), None),
        ] {
            assert_eq!(logical_key(code), (key, text.map(str::to_owned)), "{code:?}");
        }
    }

    #[test]
    fn characters_are_typed_with_the_keys_of_a_us_keyboard() {
        for (character, code, key, text) in [
            ('q', KeyCode::KeyQ, Key::Character("q".into()), Some("q")),
            ('Q', KeyCode::KeyQ, Key::Character("Q".into()), Some("Q")),
            ('7', KeyCode::Digit7, Key::Character("7".into()), Some("7")),
            (' ', KeyCode::Space, Key::Space, Some(" ")),
            ('\n', KeyCode::Enter, Key::Enter, None),
            ('é', KeyCode::Unidentified(NativeKeyCode::Unidentified), Key::Character("é".into()), Some("é")),
        ] {
            assert_eq!(typing_key(character), (code, key, text.map(str::to_owned)), "{character:?}");
        }
    }
}
