//! A window in which a person plays, and hands over to a policy or a bot and back.
//!
//! The game runs as it does without a window: its rules, the recorder and the policy see fixed ticks only, so that what
//! was recorded here replays headless. The window adds a clock, a keyboard and a camera, and with the feature `view3d` a view in
//! space for games that have one.
//!
//! Games whose ticks are frames draw themselves, and are shown as they are. What a person does there becomes an action
//! first, which then presses the game's keys as a bot's would: the game sees nothing that the recording does not hold.

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
