//! What a key means on a US keyboard: messages about keys say so beside the key's place.

use bevy::{
    input::keyboard::{Key, NativeKey},
    prelude::*,
};

use super::names::unit_variant;

/// Meaning of a key, and the text that it types.
pub(super) fn logical_key(code: KeyCode) -> (Key, Option<String>) {
    let name = format!("{code:?}");
    if let Some(character) = typed(&name) {
        // Bevy calls the space bar by its name, and it types a space all the same.
        let key = if character == " " { Key::Space } else { Key::Character(character.as_str().into()) };
        return (key, Some(character));
    }
    let plain = name.strip_prefix("Numpad").unwrap_or(&name);
    let plain = plain.strip_suffix("Left").or(plain.strip_suffix("Right")).unwrap_or(plain);
    // Arrow keys are called the same in both enums, and have a side in their name.
    let key = unit_variant(&name).or_else(|| unit_variant(plain));
    (key.unwrap_or(Key::Unidentified(NativeKey::Unidentified)), None)
}

/// What a key types without shift.
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
