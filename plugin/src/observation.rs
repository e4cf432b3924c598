//! Observations of agents and the sensors of named values.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::prelude::*;
//!
//! /// A system of the game: numbers near 1, which suit policies.
//! fn see(mut agents: Query<(&Transform, &mut Observation)>) {
//!     for (body, mut seen) in &mut agents {
//!         seen.set([body.translation.x / 8.0, body.translation.y / 8.0]);
//!     }
//! }
//!
//! let mut app = headless_app();
//! app.add_systems(ObserveSchedule, see);
//! let agent = (Agent::new(0, ActionSpace::Discrete(2)), VectorSensor::new(["x", "y"]), Control::Human);
//! let agent = app.world_mut().spawn((agent, Transform::from_xyz(4.0, 2.0, 0.0))).id();
//! app.tick().expect("two names and two numbers");
//! assert_eq!(app.world().get::<Observation>(agent).expect("every agent has one").vector, [0.5, 0.25]);
//! app.world_mut().entity_mut(agent).insert(VectorSensor::new(["x", "y", "speed"]));
//! assert!(app.tick().is_err(), "the speed is missing");
//! ```

use crate::{agent::Agent, carry_over::ReflectCarryComponent, episode::Episode, fault::Faults};
use bevy::prelude::*;
use playbot_learner::{EntitySet, ObsKind, Observations};
use serde::{Deserialize, Serialize};
use std::{f64::consts::TAU, sync::Arc};

/// Names and number of the values of a vector observation, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ObservationSpace {
    /// One name per value.
    pub names: Vec<String>,
}

impl ObservationSpace {
    /// Returns the number of values.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Returns whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// Returns the sets of things among the values: those with names such as `enemy[0].present`
    /// ([`EntitySensor`](crate::entities::EntitySensor)).
    pub fn sets(&self) -> Vec<EntitySet> {
        EntitySet::all_in(&self.names)
    }
}

/// A sensor of named values that the game fills. Each tick is checked against the names.
///
/// Fill [`Observation`] in a system of [`ObserveSchedule`](crate::systems::ObserveSchedule).
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, CarryComponent, Clone, Debug)]
pub struct VectorSensor {
    space: Arc<ObservationSpace>,
}

impl VectorSensor {
    /// Creates a sensor with one value per name.
    pub fn new(names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        Self::from_space(Arc::new(ObservationSpace { names: names.into_iter().map(Into::into).collect() }))
    }

    /// Creates a sensor that shares its names with others: cheap for many agents of one kind.
    pub fn from_space(space: Arc<ObservationSpace>) -> Self {
        Self { space }
    }

    /// Names of the values.
    pub fn space(&self) -> &ObservationSpace {
        &self.space
    }
}

/// The observation of the current tick.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component)]
pub struct Observation {
    /// Values in the order of the sensor's names; empty without a [`VectorSensor`].
    pub vector: Vec<f32>,
    /// Pixels `[channels, height, width]` of 0 to 255, top row first; empty without an
    /// [`ImageSensor`](crate::vision::ImageSensor). In a stack the oldest picture comes first.
    pub image: Vec<u8>,
}

impl Observation {
    /// Replaces the values, keeping the allocation.
    pub fn set(&mut self, values: impl IntoIterator<Item = f32>) {
        self.vector.clear();
        self.vector.extend(values);
    }

    /// Adds the vector, or the picture, to a batch of its kind.
    pub fn push_to(&self, batch: &mut Observations) {
        match batch {
            Observations::Vector(values) => values.extend_from_slice(&self.vector),
            Observations::Image(pixels) => pixels.extend_from_slice(&self.image),
        }
    }
}

/// Gives every agent an observation.
pub(crate) fn plugin(app: &mut App) {
    app.register_required_components::<Agent, Observation>();
}

/// Empties a batch for observations of a kind, reusing its memory where possible.
pub(crate) fn start_batch(batch: &mut Observations, kind: &ObsKind) {
    match (&mut *batch, kind) {
        (Observations::Vector(_), ObsKind::Vector(_)) | (Observations::Image(_), ObsKind::Image(_)) => batch.clear(),
        _ => *batch = Observations::empty(kind),
    }
}

/// Reports observations of the wrong length or with values that are not numbers, with agent, tick and name.
pub fn check_observations(agents: Query<(&Agent, &VectorSensor, &Observation, &Episode)>, mut faults: ResMut<Faults>) {
    for (agent, sensor, observation, episode) in &agents {
        if !episode.is_running() {
            continue;
        }
        let (expected, got) = (sensor.space.len(), observation.vector.len());
        if got != expected {
            faults.report(format!(
                "{}: the observation has {got} values, its sensor names {expected}; fill every value each tick",
                episode.moment(agent)
            ));
        } else if let Some(bad) = first_non_finite(&observation.vector) {
            faults.report(format!(
                "{}: observation `{}` is {}; the game must not produce it",
                episode.moment(agent),
                sensor.space.names[bad],
                observation.vector[bad]
            ));
        }
    }
}

/// Returns the index of the first value that is NaN or infinite. Sums first, since almost all
/// vectors are finite.
fn first_non_finite(values: &[f32]) -> Option<usize> {
    let sum: f32 = values.iter().map(|value| value * 0.0).sum();
    if sum == 0.0 { None } else { values.iter().position(|value| !value.is_finite()) }
}

impl Observation {
    /// Returns the positional encoding of a position: sin and cos of 2π `place` / length for each
    /// of `lengths`, in order. Each length gives two numbers between -1 and 1. Position and lengths
    /// have the same unit. A length of 0 gives NaN. The numbers are the same on every machine.
    /// [`ObservationSpace::positional_encoding_names`] names them.
    ///
    /// Use it for a bot that must distinguish half a metre on a map of a hundred. A network learns
    /// slowly when the relevant change is tiny compared with an input's range. It learns quickly
    /// from periods as long as the relevant distance, together with some longer ones. These are
    /// Fourier features (Tancik et al., "Fourier Features Let Networks Learn High Frequency
    /// Functions in Low Dimensional Domains", 2020). Li and Pathak ("Functional Regularization for
    /// Reinforcement Learning via Learned Fourier Features", 2021) bring them to reinforcement
    /// learning; here they are fixed.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use bevy_playbot::prelude::*;
    ///
    /// /// In metres: four corridors, two and one.
    /// const LENGTHS: [f64; 3] = [16.0, 8.0, 4.0];
    ///
    /// fn see(mut agents: Query<(&Transform, &mut Observation)>) {
    ///     for (body, mut seen) in &mut agents {
    ///         let x = body.translation.x;
    ///         seen.set([x / 100.0].into_iter().chain(Observation::positional_encoding(x.into(), LENGTHS)));
    ///     }
    /// }
    ///
    /// let encoded = ObservationSpace::positional_encoding_names("x", LENGTHS);
    /// let names: Vec<_> = ["x".to_owned()].into_iter().chain(encoded).collect();
    /// let mut app = headless_app();
    /// app.add_systems(ObserveSchedule, see);
    /// let agent = (Agent::new(0, ActionSpace::Discrete(2)), VectorSensor::new(names), Control::Human);
    /// app.world_mut().spawn((agent, Transform::from_xyz(2.0, 0.0, 0.0)));
    /// app.tick().expect("as many numbers as names");
    /// ```
    pub fn positional_encoding(place: f64, lengths: impl IntoIterator<Item = f64>) -> impl Iterator<Item = f32> {
        lengths.into_iter().flat_map(move |length| {
            let (sine, cosine) = libm::sincos(TAU * place / length);
            [sine as f32, cosine as f32]
        })
    }
}

impl ObservationSpace {
    /// Returns names for [`Observation::positional_encoding`] along `axis`, in order: `x sine of 8`, `x cosine of
    /// 8`, where 8 is the length in its unit.
    pub fn positional_encoding_names(
        axis: &str,
        lengths: impl IntoIterator<Item = f64>,
    ) -> impl Iterator<Item = String> {
        lengths
            .into_iter()
            .flat_map(move |length| ["sine", "cosine"].map(|function| format!("{axis} {function} of {length}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoding_by_hand() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let encoded = |place| -> Vec<f32> { Observation::positional_encoding(place, [8.0, 4.0, 2.0, 1.0]).collect() };
        let forth = [half, half, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0];
        // Minus an eighth of π, a quarter, a half and a whole.
        let back = [-0.382_683_43, 0.923_879_5, -half, half, -1.0, 0.0, 0.0, -1.0];
        for (encoded, wanted) in [(encoded(1.0), forth), (encoded(-0.5), back)] {
            assert_eq!(encoded.len(), wanted.len());
            assert!(
                encoded.iter().zip(&wanted).all(|(encoded, wanted)| (encoded - wanted).abs() < 1e-6),
                "{encoded:?}, {wanted:?}"
            );
        }
        let names: Vec<_> = ObservationSpace::positional_encoding_names("x", [8.0, 0.5]).collect();
        assert_eq!(names, ["x sine of 8", "x cosine of 8", "x sine of 0.5", "x cosine of 0.5"]);
    }
}
