//! Errors of camera sensors.

use bevy::prelude::*;
use thiserror::Error;

use crate::vision::VisionError;

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
pub(super) struct NoImage {
    /// `sprite` or `tile layer`.
    pub(super) what: &'static str,
    pub(super) entity: Entity,
    pub(super) name: Option<Name>,
    pub(super) why: String,
}

fn called(name: &Option<Name>) -> String {
    name.as_ref().map_or_else(String::new, |name| format!(" (named `{name}`)"))
}
