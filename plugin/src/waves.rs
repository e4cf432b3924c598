//! Positional encoding: sine and cosine features of a position.

use std::f64::consts::TAU;

use crate::observation::{Observation, ObservationSpace};

impl Observation {
    /// Returns the positional encoding of a position: sin and cos of 2π `place` / length for each
    /// of `lengths`, in order. Each length gives two numbers between -1 and 1. Position and lengths
    /// have the same unit. A length of 0 gives NaN. The numbers are the same on every machine.
    /// [`ObservationSpace::wave_names`] names them.
    ///
    /// Use it for a bot that must distinguish half a metre on a map of a hundred. A network learns
    /// slowly when the relevant change is tiny compared with an input's range. It learns quickly
    /// from waves as long as the relevant distance, together with some longer ones. These are
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
    ///         seen.set([x / 100.0].into_iter().chain(Observation::waves(x.into(), LENGTHS)));
    ///     }
    /// }
    ///
    /// let names: Vec<_> = ["x".to_owned()].into_iter().chain(ObservationSpace::wave_names("x", LENGTHS)).collect();
    /// let mut app = headless_app();
    /// app.add_systems(ObserveSchedule, see);
    /// let agent = (Agent::new(0, ActionSpace::Discrete(2)), VectorSensor::new(names), Control::Human);
    /// app.world_mut().spawn((agent, Transform::from_xyz(2.0, 0.0, 0.0)));
    /// app.tick().expect("as many numbers as names");
    /// ```
    pub fn waves(place: f64, lengths: impl IntoIterator<Item = f64>) -> impl Iterator<Item = f32> {
        lengths.into_iter().flat_map(move |length| {
            let (sine, cosine) = libm::sincos(TAU * place / length);
            [sine as f32, cosine as f32]
        })
    }
}

impl ObservationSpace {
    /// Returns names for [`Observation::waves`] along `axis`, in order: `x sine of 8`, `x cosine of
    /// 8`, where 8 is the length in its unit.
    pub fn wave_names(axis: &str, lengths: impl IntoIterator<Item = f64>) -> impl Iterator<Item = String> {
        lengths.into_iter().flat_map(move |length| ["sine", "cosine"].map(|wave| format!("{axis} {wave} of {length}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_by_hand() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let told = |place| -> Vec<f32> { Observation::waves(place, [8.0, 4.0, 2.0, 1.0]).collect() };
        let forth = [half, half, 1.0, 0.0, 0.0, -1.0, 0.0, 1.0];
        // Minus an eighth of π, a quarter, a half and a whole.
        let back = [-0.382_683_43, 0.923_879_5, -half, half, -1.0, 0.0, 0.0, -1.0];
        for (told, wanted) in [(told(1.0), forth), (told(-0.5), back)] {
            assert_eq!(told.len(), wanted.len());
            assert!(
                told.iter().zip(&wanted).all(|(told, wanted)| (told - wanted).abs() < 1e-6),
                "{told:?}, {wanted:?}"
            );
        }
        let names: Vec<_> = ObservationSpace::wave_names("x", [8.0, 0.5]).collect();
        assert_eq!(names, ["x sine of 8", "x cosine of 8", "x sine of 0.5", "x cosine of 0.5"]);
    }
}
