//! Games without any code for the plugin, for tests of the adapter. Each is small and complete.

pub mod catch;
pub mod faulty_catch;
pub mod pong;
pub mod rooms;
pub mod stubborn;
mod traces;

pub use traces::traces;
