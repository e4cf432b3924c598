//! What ants and the ground they walk on look like, for every game with ants.
//!
//! A game says what there is to be seen with [`AntPose`], [`GoalMark`] and [`OnGround`] on its agents and [`Ground`] on
//! their arenas, in [`AntViewSystems::Show`]. It is drawn from above with sprites, for sensors and windows, and with the
//! feature `view3d` also in space with meshes, for windows.

mod components;
mod flat;
#[cfg(feature = "view3d")]
mod solid;

pub use components::{AntPose, GoalMark, Ground, OnGround};
pub use flat::VIEW;
#[cfg(feature = "view3d")]
pub use solid::SolidViewPlugin;

use bevy::prelude::*;
use bevy_playbot::vision::VisionSystems;
use playbot_lab::prelude::*;

/// Parts of [`VisionSystems::Dress`] for games with ants, in this order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AntViewSystems {
    /// The game brings poses, goals and grounds up to date.
    Show,
    /// They become what is drawn.
    Draw,
}

/// Draws ants. Add it after the plugins that bring images, such as Bevy's own or a sensor's.
#[derive(Clone, Copy, Debug, Default)]
pub struct AntViewPlugin;

impl Plugin for AntViewPlugin {
    fn build(&self, app: &mut App) {
        app.configure_sets(
            ObserveSchedule,
            (AntViewSystems::Show, AntViewSystems::Draw).chain().in_set(VisionSystems::Dress),
        );
        flat::build(app);
    }
}
