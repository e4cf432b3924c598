//! A game small enough to know every number of it by heart, for tests of the plugin.

mod as_corridor;
pub mod come_and_go;
mod corridor;
mod documentation;
pub mod faulty;
pub mod foreign;
pub mod hostile;
pub mod measuring;
pub mod memory;
mod painted;
pub mod planted;
pub mod power_cut;
pub mod recording;
pub mod scene;
pub mod small;
pub mod soak;
pub mod training;

pub use corridor::{Cell, Corridor, Drift, PoisonAt, corridor_plugin, see_corridor, spawn_walker};
pub use painted::PaintedCorridor;
