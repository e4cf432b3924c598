//! Pictures from Bevy's renderer, on a GPU or on software Vulkan.
//!
//! Give an agent a [`CameraSensor`] and add the [`CameraSensorPlugin`]. In each tick its
//! [`Frame`](crate::vision::Frame) then holds the World of that tick, after
//! [`VisionSystems::Sync`](crate::vision::VisionSystems::Sync).
//!
//! # How it is drawn
//!
//! The renderer is taken out of Bevy's loop and run by hand, in
//! [`VisionSystems::Render`](crate::vision::VisionSystems::Render). The scene is extracted, drawn and read back
//! before any agent decides, so no frame is late.
//!
//! A Bevy camera costs about half a millisecond, however little it sees. Sensors that follow a target therefore share
//! one camera, whose whole work on the CPU is done once. Its items are distributed to one cell of a common texture
//! for each agent. Each cell is drawn with a view of its own in the same render pass. One copy and one mapped buffer
//! bring all cells back. Sensors that reuse a camera of the game draw it unchanged into its own texture, and come
//! back in the same buffer.
//!
//! Frames carry the number of the pass in which they were extracted through the render world. A frame with another
//! number is reported in [`Faults`](crate::fault::Faults), with its agent and tick, and is not used.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_playbot::{camera::{CameraSensor, CameraSensorPlugin}, prelude::*, vision::ImageOptions};
//!
//! let mut app = headless_app();
//! app.add_plugins(CameraSensorPlugin::headless()?);
//! let green = Sprite::from_color(Color::srgb(0.0, 1.0, 0.0), Vec2::splat(2.0));
//! let player = app.world_mut().spawn((green, Transform::default())).id();
//! // 16 units of the world around the player, as 64 × 64 pixels.
//! let sensor = CameraSensor::following(player, 16.0, ImageOptions::default());
//! app.world_mut().spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human, sensor));
//! app.finish();
//! app.cleanup();
//! app.tick().expect("it can be drawn");
//! # Ok::<(), bevy_playbot::vision::VisionError>(())
//! ```

mod adapter;
mod atlas;
mod borrow;
mod error;
mod fill_frames;
mod images;
mod plugin;
mod prepare;
mod readback;
mod render_list;
mod renderer;
mod request;
mod scene_schedule;
mod sensor;
mod sensor_view;
mod sensor_view_draw;
mod tiles;

pub(crate) use adapter::{creation as drawing, none as not_drawing};
pub use error::CameraError;
pub use plugin::CameraSensorPlugin;
pub(crate) use render_list::RenderListPlugin;
pub use sensor::{CameraSensor, CameraSource};
pub use sensor_view::SensorCamera;
pub use tiles::TileBorder;

// For playbot_lab, playbot_cli and tests; games need none of it.
#[doc(hidden)]
pub use readback::ReadbackDelay;
#[doc(hidden)]
pub use tiles::TileLayerPlugin;
