//! Checks of the images that sensors produce.

use bevy::prelude::*;

use super::{ImageSensor, is_observed};
use crate::{agent::Agent, control::Control, episode::Episode, fault::Faults, observation::Observation};

/// Reports images of the wrong length, with agent and tick.
pub(crate) fn check_images(
    agents: Query<(&Agent, &ImageSensor, &Observation, &Control, &Episode)>,
    mut faults: ResMut<Faults>,
) {
    for (agent, sensor, observation, control, episode) in &agents {
        let (expected, got) = (sensor.0.shape().numbers(), observation.image.len());
        if is_observed(control, episode) && got != expected {
            faults.report(format!(
                "{}: the observation's image has {got} bytes, its sensor makes {expected}; add the sensor and its \
                 plugin, and leave the image to them",
                episode.moment(agent)
            ));
        }
    }
}
