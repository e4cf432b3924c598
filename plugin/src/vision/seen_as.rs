//! Observations of agents as a reader expects them.

use playbot_learner::ObsKind;

use super::ImageSensor;
use crate::observation::Observation;

/// Returns an agent's observation in the kind of `wanted`; an agent may have sensors of both kinds.
pub(crate) fn seen_as(wanted: &ObsKind, observation: &Observation, sensor: Option<&ImageSensor>) -> ObsKind {
    let image = sensor.map(|sensor| sensor.0.shape()).filter(|shape| shape.numbers() == observation.image.len());
    let vector = ObsKind::Vector(observation.vector.len());
    match (wanted, image) {
        (ObsKind::Image(_), Some(shape)) => ObsKind::Image(shape),
        (ObsKind::Vector(_), Some(shape)) if observation.vector.is_empty() => ObsKind::Image(shape),
        _ => vector,
    }
}
