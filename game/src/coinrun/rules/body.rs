//! The rectangle of every body.

use super::constants::{BLOCK_HALF, ENEMY_SPEED, PLAYER_HALF_HEIGHT, PLAYER_HALF_WIDTH, START_CELL};

/// An axis-aligned rectangle with a velocity.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Body {
    /// Centre, tiles from the left.
    pub x: f32,
    /// Centre, tiles from the bottom.
    pub y: f32,
    /// Horizontal velocity, tiles per step.
    pub vx: f32,
    /// Vertical velocity, tiles per step.
    pub vy: f32,
    /// Half width, tiles.
    pub rx: f32,
    /// Half height, tiles.
    pub ry: f32,
}

impl Body {
    /// Returns the player at the start of every level.
    pub fn player() -> Self {
        Self {
            x: START_CELL[0] as f32 + PLAYER_HALF_WIDTH,
            y: START_CELL[1] as f32 + PLAYER_HALF_HEIGHT,
            vx: 0.0,
            vy: 0.0,
            rx: PLAYER_HALF_WIDTH,
            ry: PLAYER_HALF_HEIGHT,
        }
    }

    /// Returns a saw or a crate: a resting square that fills `cell`.
    pub fn block(cell: [i32; 2]) -> Self {
        Self { x: cell[0] as f32 + 0.5, y: cell[1] as f32 + 0.5, vx: 0.0, vy: 0.0, rx: BLOCK_HALF, ry: BLOCK_HALF }
    }

    /// Returns an enemy that starts in `cell` and walks to the right (`dir` 1) or to the left (-1).
    pub fn enemy(cell: [i32; 2], dir: i8) -> Self {
        Self { vx: ENEMY_SPEED * f32::from(dir), ..Self::block(cell) }
    }

    /// Returns true if the two rectangles overlap when the sum of their half sizes is changed by `margin`.
    #[inline]
    pub fn overlaps(&self, other: &Body, margin: f32) -> bool {
        let reach_x = (self.rx + other.rx) + margin;
        let reach_y = (self.ry + other.ry) + margin;
        (self.x - other.x).abs() < reach_x && (self.y - other.y).abs() < reach_y
    }
}
