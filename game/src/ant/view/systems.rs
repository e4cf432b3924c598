//! When ants are drawn.

use bevy::prelude::*;

/// Parts of [`VisionSystems::Dress`](bevy_playbot::vision::VisionSystems::Dress) for games with ants, in this order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AntViewSystems {
    /// The game brings poses, goals and grounds up to date.
    Show,
    /// They become what is drawn.
    Draw,
}
