//! When ants are drawn.

use bevy::prelude::*;

/// Parts of [`VisionSystems::Sync`](bevy_playbot::vision::VisionSystems::Sync) for games with ants, in this order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AntViewSystems {
    /// The game brings poses, goals and grounds up to date.
    Show,
    /// They become what is drawn.
    Draw,
}
