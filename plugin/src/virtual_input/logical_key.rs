//! Meanings of keys on a US keyboard, for messages that carry both the meaning and the position of a key.

use bevy::{
    input::keyboard::{Key, NativeKey},
    prelude::*,
};

use super::names::unit_variant;

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
}
