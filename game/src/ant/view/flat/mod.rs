//! View from above, with sprites.

mod art;
mod ground;
mod layers;
mod limbs;
mod plugin;

pub use layers::VIEW;
pub(super) use plugin::FlatViewPlugin;
#[cfg(feature = "view3d")]
pub(super) use {
    art::floor_tile,
    limbs::{GOAL_COLOUR, colour},
};
