//! Pictures from Bevy cameras.

mod sensor;

pub use sensor::CameraSensor;

use crate::vision::VisionError;
use bevy::prelude::*;

/// Adds [`CameraSensor`]s to a game.
#[derive(Clone, Debug, Default)]
pub struct CameraSensorPlugin;

impl CameraSensorPlugin {
    /// For an app without a window: brings Bevy's renderer along.
    ///
    /// # Errors
    ///
    /// No graphics adapter.
    pub fn headless() -> Result<Self, VisionError> {
        Ok(Self)
    }
}

impl Plugin for CameraSensorPlugin {
    fn build(&self, _app: &mut App) {}
}
