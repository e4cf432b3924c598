//! `playbot replay`.

#[cfg(not(feature = "window"))]
mod no_window;
mod picture;
mod shorter;
mod told;
mod verb;
#[cfg(feature = "window")]
mod window;

pub use verb::{Args, run};
