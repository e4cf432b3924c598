//! A window in which a person plays, and hands over to a policy or a bot and back.
//!
//! The game runs as it does without a window. Its rules, the recorder and the policy see fixed ticks only, so its
//! recordings replay headless. The window adds a clock, a keyboard and a camera. The feature `view3d` adds a view in
//! space for games that have one.
//!
//! Games whose ticks are frames draw themselves, and are shown as they are. A person's keys there become an action
//! first, which then presses the game's keys as a bot's would. The game therefore sees no input that the recording
//! lacks.

mod app;
mod camera;
mod devices;
mod ending;
mod error;
mod frames;
mod gamepads;
mod keys;
mod own_keys;
mod pace;
mod playlist;
mod replayed;
mod score;
mod seats;
#[cfg(feature = "view3d")]
mod solid;
mod title;

pub use app::{GameWindow, WindowSetup};
pub use error::WindowError;
pub use playlist::Playlist;
pub use seats::Autopilot;
