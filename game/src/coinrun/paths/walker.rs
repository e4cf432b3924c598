//! A player on a path.

use super::ground::Ground;
use crate::coinrun::rules::{Body, PlayerState, is_supported};

/// A player on a path. Its size is that of the [`Ground`].
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Walker {
    /// Centre, tiles from the left.
    pub x: f32,
    /// Centre, tiles from the bottom.
    pub y: f32,
    /// Horizontal velocity, tiles per step.
    pub vx: f32,
    /// Vertical velocity, tiles per step, upwards.
    pub vy: f32,
    /// A jump would work now. No other memory of the player matters to the next step.
    pub supported: bool,
}

impl Walker {
    /// Returns a player at the beginning of a path.
    pub fn new(body: &Body, memory: &PlayerState, ground: &Ground) -> Self {
        let supported = is_supported(body, memory, ground.tiles);
        Self { x: body.x, y: body.y, vx: body.vx, vy: body.vy, supported }
    }

    /// Returns the player's body by the rules.
    #[inline]
    pub fn body(&self, ground: &Ground) -> Body {
        Body { x: self.x, y: self.y, vx: self.vx, vy: self.vy, rx: ground.rx, ry: ground.ry }
    }
}
