//! System sets of drawing ants.

use bevy::prelude::*;

/// Parts of [`VisionSystems::Sync`](bevy_playbot::vision::VisionSystems::Sync) for games with ants, in this order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AntViewSystems {
    /// The game updates poses, goals and grounds.
    Show,
    /// Sprites and meshes follow them.
    Draw,
}
