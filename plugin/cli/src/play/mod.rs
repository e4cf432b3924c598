//! `playbot play`.

mod args;
#[cfg(not(feature = "window"))]
mod no_window;
#[cfg(feature = "window")]
mod window;

pub use args::Args;
#[cfg(not(feature = "window"))]
pub use no_window::{no_window, run};
#[cfg(feature = "window")]
pub use window::run;
