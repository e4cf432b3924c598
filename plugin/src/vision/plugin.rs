//! The plugin that all sensors of pictures share.

use bevy::prelude::*;

use super::{VisionSystems, blank, compose};
use crate::systems::ObserveSchedule;

/// Makes observations from the frames of any sensor. The sensors' plugins add it.
#[derive(Clone, Copy, Debug, Default)]
pub struct VisionPlugin;

impl VisionPlugin {
    /// Adds the plugin unless another sensor did.
    pub fn add_to(app: &mut App) {
        if !app.is_plugin_added::<Self>() {
            app.add_plugins(Self);
        }
    }
}

impl Plugin for VisionPlugin {
    fn build(&self, app: &mut App) {
        app.configure_sets(
            ObserveSchedule,
            (VisionSystems::Sync, VisionSystems::Render, VisionSystems::Compose).chain(),
        )
        // Games fill the vector of an observation and this the image, so their order does not matter.
        .add_systems(ObserveSchedule, compose::compose.in_set(VisionSystems::Compose).ambiguous_with_all())
        .add_observer(blank::report_blank);
    }
}
