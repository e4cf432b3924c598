//! Pictures from Bevy's renderer, on a GPU or on software Vulkan.
//!
//! Give an agent a [`CameraSensor`] and add the [`CameraSensorPlugin`]. In each tick its
//! [`Frame`](crate::vision::Frame) then holds the World of that tick, after
//! [`VisionSystems::Sync`].
//!
//! # How it is drawn
//!
//! The renderer is taken out of Bevy's loop and run by hand, in
//! [`VisionSystems::Render`]. The scene is extracted, drawn and read back
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
//! The files of the folder, in reading order:
//!
//! - `readback`: one pass of all sensors, from the requests to the frames.
//! - `request`: the requests of agents for pictures.
//! - `sensor_view`: views of agents, and their drawing with one camera.
//! - `renderer`: Bevy's renderer, run by hand.
//! - `tiles`: the drawing of tile layers.
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

mod readback;
mod renderer;
mod request;
mod sensor_view;
mod tiles;

use crate::{
    camera::{
        readback::{Atlas, Readback, fill_frames},
        renderer::{Renderer, add_renderer},
        request::BorrowedTargets,
        sensor_view::{SensorViews, Stamp},
    },
    systems::ObserveSchedule,
    vision::{ImageOptions, ImageSensor, VisionError, VisionPlugin, VisionSystems},
};
use bevy::{
    prelude::*,
    render::{RenderApp, RenderPlugin},
};
use thiserror::Error;

pub use crate::camera::readback::ReadbackDelay;
pub(crate) use crate::camera::renderer::creation as drawing;
pub use crate::camera::tiles::TileLayerPlugin;
pub use crate::camera::{sensor_view::SensorCamera, tiles::TileBorder};

/// Fills an agent's [`Frame`](crate::vision::Frame) with the picture of Bevy's renderer.
///
/// A sensor that follows a target sees the 2D scene on render layer 0, in front of the World's `ClearColor`: sprites,
/// tile layers, 2D meshes. Colours come back as the bytes of the images they are from.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component)]
#[require(ImageSensor)]
pub struct CameraSensor {
    /// The viewpoint.
    pub source: CameraSource,
}

impl CameraSensor {
    /// Returns the components of an agent that sees `width` units of the world around `target`.
    pub fn following(target: Entity, width: f32, image: ImageOptions) -> (Self, ImageSensor) {
        (Self { source: CameraSource::Following { target, width } }, ImageSensor(image))
    }

    /// Returns the components of an agent that sees through the game's own camera: see [`CameraSource::OfGame`].
    pub fn of_game(image: ImageOptions) -> (Self, ImageSensor) {
        (Self { source: CameraSource::OfGame }, ImageSensor(image))
    }

    /// Returns the components of an agent that sees through a camera of the game, 2D or 3D, scaled to the picture's
    /// size.
    ///
    /// Several agents may look through one camera if their pictures have the same size. The camera's own target may not
    /// exist, such as the window of an app without one. Then it draws as for a window of the picture's size.
    pub fn of(camera: Entity, image: ImageOptions) -> (Self, ImageSensor) {
        (Self { source: CameraSource::Camera(camera) }, ImageSensor(image))
    }
}

/// The viewpoint of a [`CameraSensor`].
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub enum CameraSource {
    /// Straight down on the 2D scene around an entity.
    Following {
        /// The entity in the middle of the picture. It needs a `Transform`.
        target: Entity,
        /// World units from the left to the right edge of the picture.
        width: f32,
    },
    /// Through a camera of the game.
    Camera(Entity),
    /// Through the game's own camera, whichever entity it is now: of several active ones, the one that draws first.
    OfGame,
}

/// Adds [`CameraSensor`]s to a game.
///
/// In an app without a renderer, [`headless`](Self::headless) adds Bevy's. In a game with a window, add the plugin
/// after `DefaultPlugins` and disable `PipelinedRenderingPlugin` if it exists (Bevy's feature `multi_threaded`). The
/// plugin runs the renderer itself: for sensors in the middle of a tick, for windows in `Last`.
#[derive(Clone, Debug, Default)]
pub struct CameraSensorPlugin {
    headless: bool,
}

impl CameraSensorPlugin {
    /// Creates the plugin for an app without a window. It adds the parts of the renderer that the app lacks.
    ///
    /// # Errors
    ///
    /// [`VisionError::NoAdapter`].
    pub fn headless() -> Result<Self, VisionError> {
        renderer::check()?;
        Ok(Self { headless: true })
    }

    /// Creates the plugin for an app with or without a window. It adds a renderer only if the app has none.
    ///
    /// # Errors
    ///
    /// [`VisionError::NoAdapter`].
    pub fn for_app(app: &App) -> Result<Self, VisionError> {
        if app.get_sub_app(RenderApp).is_some() { Ok(Self::default()) } else { Self::headless() }
    }
}

impl Plugin for CameraSensorPlugin {
    fn build(&self, app: &mut App) {
        if app.is_plugin_added::<RenderPlugin>() && !app.world().contains_resource::<NoScreen>() {
            app.add_systems(Last, renderer::draw_windows);
            app.insert_resource(ShowsWindows);
        }
        if self.headless {
            add_renderer(app, renderer::creation());
        } else if !app.is_plugin_added::<TileLayerPlugin>() && app.get_sub_app(RenderApp).is_some() {
            app.add_plugins(TileLayerPlugin);
        }
        VisionPlugin::add_to(app);
        sensor_view::add_sensor_views(app);
        app.init_resource::<ReadbackDelay>()
            .init_resource::<Atlas>()
            .init_resource::<BorrowedTargets>()
            .init_resource::<SensorViews>()
            .init_resource::<Stamp>()
            .init_resource::<Readback>()
            .init_resource::<request::MissingImages>()
            // It reads everything that can be drawn; changes made in `Sync` or before are seen.
            .add_systems(ObserveSchedule, fill_frames.in_set(VisionSystems::Render).ambiguous_with_all());
    }

    fn cleanup(&self, app: &mut App) {
        renderer::keep_memory();
        let shows_windows = app.world().contains_resource::<ShowsWindows>();
        if let Some(renderer) = Renderer::take(app, shows_windows) {
            app.insert_resource(renderer);
        }
    }
}

/// Marks an app with its own renderer, which draws windows.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct ShowsWindows;

/// The reason why an agent got no picture in a tick. Reported in [`Faults`](crate::fault::Faults) with the agent and
/// the tick.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum CameraError {
    /// A width or height that is not allowed.
    #[error(transparent)]
    Size(#[from] VisionError),
    /// A picture larger than the adapter can draw.
    #[error("a picture of {width}x{height} is over the graphics adapter's limit of {limit} pixels a side")]
    OverLimit {
        /// Columns of pixels.
        width: u32,
        /// Rows of pixels.
        height: u32,
        /// The largest side that the adapter allows.
        limit: u32,
    },
    /// All pictures together are larger than the adapter can draw.
    #[error(
        "{agents} pictures together are over the graphics adapter's limit of {limit}x{limit} pixels; \
         use fewer agents in one World, or smaller pictures"
    )]
    TooMany {
        /// Number of agents with pictures.
        agents: usize,
        /// Largest side in pixels.
        limit: u32,
    },
    /// The width of the view is not a positive length.
    #[error("its sensor is {0} world units wide; the width must be positive and finite")]
    Width(f32),
    /// The target was despawned, or has no position.
    #[error("the target {0} of its sensor does not exist or has no Transform; despawn the sensor with its target")]
    NoTarget(Entity),
    /// The camera was despawned, or is no camera.
    #[error("the camera {0} of its sensor does not exist or is no camera; despawn the sensor with its camera")]
    NoCamera(Entity),
    /// The game draws on a target without pixels, which would stop the renderer.
    #[error(
        "the camera {camera} draws on a target of {}x{} pixels, which has no room for a picture; give it a width and a height \
         of at least 1", .size.x, .size.y
    )]
    EmptyTarget {
        /// The camera.
        camera: Entity,
        /// Columns and rows of pixels.
        size: UVec2,
    },
    /// The game has no camera.
    #[error("the game has no active camera of its own to look through; spawn one when a level begins")]
    NoOwnCamera,
    /// Two agents request different pictures of one camera.
    #[error("another agent looks through the same camera {0} in another size; give them the same size")]
    CameraShared(Entity),
    /// The picture that came back is an older one.
    #[error("the readback is late: its picture is of the World's tick {got}, not {wanted}, and was not used")]
    Stale {
        /// Tick of the World when the picture was requested.
        wanted: u64,
        /// Tick of the picture.
        got: u64,
    },
    /// No picture came back.
    #[error("no picture came back: {0}")]
    Missing(String),
    /// The renderer is not available.
    #[error(
        "there is no renderer: add CameraSensorPlugin::headless(), or add CameraSensorPlugin after DefaultPlugins \
         without PipelinedRenderingPlugin"
    )]
    NoRenderer,
    /// Shaders or images did not become ready.
    #[error("{0} are not ready after {1} seconds")]
    NotReady(&'static str, u64),
}

/// A drawn entity lacks its image.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{what} {entity} has no image{}: {why}", called(.name))]
struct NoImage {
    /// `sprite` or `tile layer`.
    what: &'static str,
    entity: Entity,
    name: Option<Name>,
    why: String,
}

fn called(name: &Option<Name>) -> String {
    name.as_ref().map_or_else(String::new, |name| format!(" (named `{name}`)"))
}

/// Marks an app without a screen: only the pictures of agents need to be drawn.
#[derive(Resource, Clone, Copy, Debug, Reflect)]
#[reflect(Resource)]
struct NoScreen;

/// Marks an app with [`NoScreen`].
pub(crate) struct NoScreenPlugin;

impl Plugin for NoScreenPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(NoScreen);
    }
}
