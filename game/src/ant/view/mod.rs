//! The look of ants and of the ground they walk on, for every game with ants.
//!
//! A game describes its scene with [`AntPose`], [`GoalMark`] and [`OnGround`] on its agents and [`Ground`] on their
//! arenas, in [`AntViewSystems::Show`]. It is drawn from above with sprites, for sensors and windows, and with the
//! feature `view3d` also in space with meshes, for windows.

mod components;
mod flat;
mod plugin;
#[cfg(feature = "view3d")]
mod solid;
mod systems;

pub use components::{AntPose, GoalMark, Ground, OnGround};
pub use flat::VIEW;
pub use plugin::AntViewPlugin;
#[cfg(feature = "view3d")]
pub use solid::{SolidAnt, SolidViewPlugin};
pub use systems::AntViewSystems;
