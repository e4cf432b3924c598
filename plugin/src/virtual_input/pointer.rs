//! Positions in the window that the mouse cursor or a finger points at.

use bevy::prelude::*;
use std::fmt;

/// A position in the primary window, from its top left corner to the right and downwards.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_playbot::virtual_input::PointerPosition;
///
/// let window = Vec2::new(1280.0, 720.0);
/// assert_eq!(PointerPosition::fraction(0.5, 0.25).within(window), Some(Vec2::new(640.0, 180.0)));
/// assert_eq!(PointerPosition::pixels(1280.0, 0.0).within(window), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub enum PointerPosition {
    /// Logical pixels.
    Pixels(Vec2),
    /// Fractions of the window's width and height: from 0 to below 1.
    Fraction(Vec2),
}

impl PointerPosition {
    /// Creates a position in logical pixels.
    pub fn pixels(x: f32, y: f32) -> Self {
        Self::Pixels(Vec2::new(x, y))
    }

    /// Creates a position by fractions of the window's width and height.
    pub fn fraction(x: f32, y: f32) -> Self {
        Self::Fraction(Vec2::new(x, y))
    }

    /// Returns the position in logical pixels; `None` if it is outside of a window of this size.
    pub fn within(self, window: Vec2) -> Option<Vec2> {
        let position = match self {
            Self::Pixels(position) => position,
            Self::Fraction(fraction) => fraction * window,
        };
        let is_inside = self.is_possible() && position.cmplt(window).all();
        is_inside.then_some(position)
    }

    /// Returns whether it lies inside of windows of some size.
    pub(super) fn is_possible(self) -> bool {
        let (Self::Pixels(at) | Self::Fraction(at)) = self;
        let is_near = !matches!(self, Self::Fraction(_)) || at.cmplt(Vec2::ONE).all();
        at.is_finite() && at.cmpge(Vec2::ZERO).all() && is_near
    }
}

impl fmt::Display for PointerPosition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pixels(at) => write!(f, "pixel ({}, {})", at.x, at.y),
            Self::Fraction(at) => write!(f, "fraction ({}, {})", at.x, at.y),
        }
    }
}

/// The mouse cursor of an agent, at its last position in logical pixels.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub(super) struct Cursor {
    pub agent: Entity,
    pub at: Vec2,
}

/// A finger of an agent that is down on the touch screen.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub(super) struct Finger {
    pub agent: Entity,
    pub id: u64,
    pub at: Vec2,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_outside_of_the_window_are_none() {
        let window = Vec2::new(200.0, 100.0);
        for inside in [PointerPosition::pixels(0.0, 99.0), PointerPosition::fraction(0.99, 0.0)] {
            assert!(inside.is_possible() && inside.within(window).is_some(), "{inside}");
        }
        assert!(PointerPosition::pixels(0.0, 100.0).is_possible(), "a higher window has it");
        assert_eq!(PointerPosition::pixels(0.0, 100.0).within(window), None);
        for outside in [
            PointerPosition::pixels(-1.0, 5.0),
            PointerPosition::pixels(f32::NAN, 5.0),
            PointerPosition::fraction(0.5, 1.0),
            PointerPosition::fraction(-0.1, 0.5),
        ] {
            assert!(!outside.is_possible(), "{outside}");
            assert_eq!(outside.within(window), None, "{outside}");
        }
    }
}
