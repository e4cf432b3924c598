//! View in space, with meshes, a sun and shadows, for people in a window.

mod ants;
mod plugin;
mod scenery;

pub use ants::SolidAnt;
pub use plugin::SolidViewPlugin;
