//! Inputs that can be held down.

use crate::unknown_name::nearest;
use bevy::{
    prelude::*,
    reflect::{
        FromReflect, TypeInfo, Typed,
        enums::{DynamicEnum, DynamicVariant, VariantInfo},
    },
};
use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};
use thiserror::Error;

/// A key, a mouse button or a gamepad button.
///
/// In text, keys have Bevy's names (`ArrowLeft`, `KeyW`, `Space`), and the names of others start with their device:
/// `MouseLeft`, `GamepadSouth`.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_playbot::virtual_input::VirtualButton;
///
/// assert_eq!("ArrowLeft".parse(), Ok(VirtualButton::Key(KeyCode::ArrowLeft)));
/// assert_eq!(VirtualButton::from(MouseButton::Left).to_string(), "MouseLeft");
/// let error = "ArowLeft".parse::<VirtualButton>().expect_err("no such key");
/// assert!(error.to_string().contains("did you mean `ArrowLeft`?"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Reflect)]
#[serde(try_from = "String", into = "String")]
pub enum VirtualButton {
    /// A key of the keyboard, by its position on the keyboard.
    Key(KeyCode),
    /// A button of the mouse.
    Mouse(MouseButton),
    /// A button of the agent's own gamepad.
    Gamepad(GamepadButton),
}

/// The text names no key or button.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error(
    "unknown key or button `{name}`{}; keys have Bevy's names, such as `ArrowLeft`, `KeyW` or `Space`, and other \
     names start with their device: `MouseLeft`, `GamepadSouth`",
    .near.as_ref().map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"))
)]
pub struct UnknownInput {
    /// The name that was given.
    pub name: String,
    /// The valid name nearest to it.
    pub near: Option<String>,
}

const MOUSE: &str = "Mouse";

const GAMEPAD: &str = "Gamepad";

impl fmt::Display for VirtualButton {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Key(key) => write!(f, "{key:?}"),
            Self::Mouse(button) => write!(f, "{MOUSE}{button:?}"),
            Self::Gamepad(button) => write!(f, "{GAMEPAD}{button:?}"),
        }
    }
}

impl FromStr for VirtualButton {
    type Err = UnknownInput;

    fn from_str(name: &str) -> Result<Self, UnknownInput> {
        let mouse = || unit_variant(name.strip_prefix(MOUSE)?).map(Self::Mouse);
        let gamepad = || unit_variant(name.strip_prefix(GAMEPAD)?).map(Self::Gamepad);
        let found = unit_variant(name).map(Self::Key).or_else(mouse).or_else(gamepad);
        found.ok_or_else(|| {
            let all = all_names();
            let all: Vec<&str> = all.iter().map(String::as_str).collect();
            UnknownInput { name: name.to_owned(), near: nearest(name, &all).map(str::to_owned) }
        })
    }
}

/// Names of all keys and buttons.
fn all_names() -> Vec<String> {
    let with = |place: &'static str, names: Vec<&'static str>| names.into_iter().map(move |n| format!("{place}{n}"));
    with("", unit_names::<KeyCode>())
        .chain(with(MOUSE, unit_names::<MouseButton>()))
        .chain(with(GAMEPAD, unit_names::<GamepadButton>()))
        .collect()
}

impl From<KeyCode> for VirtualButton {
    fn from(key: KeyCode) -> Self {
        Self::Key(key)
    }
}

impl From<MouseButton> for VirtualButton {
    fn from(button: MouseButton) -> Self {
        Self::Mouse(button)
    }
}

impl From<GamepadButton> for VirtualButton {
    fn from(button: GamepadButton) -> Self {
        Self::Gamepad(button)
    }
}

impl TryFrom<String> for VirtualButton {
    type Error = UnknownInput;

    fn try_from(name: String) -> Result<Self, UnknownInput> {
        name.parse()
    }
}

impl From<VirtualButton> for String {
    fn from(button: VirtualButton) -> Self {
        button.to_string()
    }
}

/// A motion or a stick that takes a number in each tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
pub enum VirtualAxis {
    /// Motion of the mouse to the right, pixels per tick.
    MouseX,
    /// Motion of the mouse downwards, pixels per tick.
    MouseY,
    /// The mouse wheel sideways, lines per tick.
    WheelX,
    /// The mouse wheel, lines per tick.
    WheelY,
    /// A stick of the agent's own gamepad, -1 to 1, held until the next tick.
    Stick(GamepadAxis),
    /// A trigger of the agent's own gamepad, 0 to 1, held until the next tick.
    Trigger(GamepadButton),
}

impl VirtualAxis {
    /// Returns whether it belongs to the gamepad. Every agent has its own.
    pub(super) fn is_gamepad(self) -> bool {
        matches!(self, Self::Stick(_) | Self::Trigger(_))
    }
}

impl From<GamepadAxis> for VirtualAxis {
    fn from(axis: GamepadAxis) -> Self {
        Self::Stick(axis)
    }
}

/// Returns the names of an enum's unit variants.
pub(super) fn unit_names<T: Typed>() -> Vec<&'static str> {
    match T::type_info() {
        TypeInfo::Enum(info) => info
            .iter()
            .filter(|variant| matches!(variant, VariantInfo::Unit(_)))
            .map(|variant| variant.name())
            .collect(),
        _ => Vec::new(),
    }
}

/// Returns the unit variant of this name, if there is one.
pub(super) fn unit_variant<T: Typed + FromReflect>(name: &str) -> Option<T> {
    unit_names::<T>().contains(&name).then(|| T::from_reflect(&DynamicEnum::new(name, DynamicVariant::Unit)))?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_reads_back() {
        for name in all_names() {
            assert_eq!(name.parse::<VirtualButton>().expect("a button").to_string(), name);
        }
    }

    #[test]
    fn a_name_that_does_not_exist_is_refused_with_the_nearest_one() {
        for (wrong, near) in [("arrowleft", "ArrowLeft"), ("Keyw", "KeyW"), ("MouseLeff", "MouseLeft")] {
            let error = wrong.parse::<VirtualButton>().expect_err("no such name");
            assert_eq!(error.near.as_deref(), Some(near), "{error}");
        }
        assert_eq!("§".parse::<VirtualButton>().expect_err("no such name").near, None);
        let error = ron::from_str::<VirtualButton>("\"GamepadSauth\"").expect_err("no such name").to_string();
        assert!(error.contains("did you mean `GamepadSouth`?"), "{error}");
    }

    #[test]
    fn every_named_key_is_found_by_its_name() {
        let names = unit_names::<KeyCode>();
        assert!(names.len() > 150 && names.contains(&"ArrowLeft"), "{}", names.len());
        for name in names {
            let key: KeyCode = unit_variant(name).expect("a key");
            assert_eq!(format!("{key:?}"), name);
        }
        assert_eq!(unit_variant::<KeyCode>("Unidentified"), None);
        assert_eq!(unit_variant::<MouseButton>("Left"), Some(MouseButton::Left));
    }
}
