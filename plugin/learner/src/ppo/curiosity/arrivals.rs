//! The observation to which each step of a rollout led, normalised for target and predictor.

use crate::{
    LearnError, ObsKind, ObsSlice, Rollout,
    nn::{ObsBatch, matrix},
    norm::{ObsNormalizer, ObsStats},
};
use burn::tensor::{Device, Tensor};
use playbot_kernels::kept_memory::{OF_A_MOVE, share};

/// Bound to which normalised observations are clipped, that of Burda et al. 2018.
const CLIP: f32 = 5.0;

/// Rows that a thread normalises at a time.
const ROWS: usize = 16;

/// The observations to which the steps of a rollout led.
///
/// They are those of the next rows and of [`Rollout::ends`]. The last observation of a terminated episode is in no
/// rollout. There it is the first one of the next episode, and for the last row the one before the step.
#[derive(Debug)]
pub(super) struct Arrivals<'a> {
    rollout: &'a Rollout,
    places: Vec<Place>,
}

/// The place of an observation in a rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Row(usize),
    /// The number of a cut episode.
    Cut(usize),
    /// The number of an environment.
    Next(usize),
}

impl<'a> Arrivals<'a> {
    /// Finds the arrivals of all rows.
    ///
    /// # Errors
    /// [`LearnError::Shape`] if the rollout lacks the states in which it stopped.
    pub(super) fn of(rollout: &'a Rollout) -> Result<Self, LearnError> {
        let (rows, envs, ends) = (rollout.rows(), rollout.envs, &rollout.ends);
        ends.next_obs.as_slice().check_size("rollout ends next_obs", &rollout.obs_kind, envs)?;
        let place = |row: usize| {
            let is_done = rollout.terminated[row] || rollout.truncated[row];
            match ends.cut_rows.binary_search(&row) {
                Ok(cut) => Place::Cut(cut),
                Err(_) if row + envs < rows => Place::Row(row + envs),
                Err(_) if is_done => Place::Row(row),
                Err(_) => Place::Next(row + envs - rows),
            }
        };
        Ok(Self { rollout, places: (0..rows).map(place).collect() })
    }

    /// Returns the number of steps.
    pub(super) fn len(&self) -> usize {
        self.places.len()
    }

    /// Adds all observations to running statistics; pixels divided by 255. Images are added tick by tick, since all of
    /// them would take much memory as numbers.
    pub(super) fn add_to(&self, normalizer: &mut ObsNormalizer) {
        let at_a_time = match self.rollout.obs_kind {
            ObsKind::Vector(_) => self.len(),
            ObsKind::Image(_) => self.rollout.envs,
        };
        let all: Vec<usize> = (0..self.len()).collect();
        for rows in all.chunks(at_a_time.max(1)) {
            normalizer.update(&self.numbers(rows, None));
        }
    }

    /// Returns these rows on `device`: clip((x - mean) / deviation, ±5).
    pub(super) fn batch(&self, rows: &[usize], stats: &ObsStats, device: &Device) -> ObsBatch {
        let numbers = self.numbers(rows, Some(stats));
        match self.rollout.obs_kind {
            ObsKind::Vector(width) => ObsBatch::Vector(matrix(numbers, rows.len(), width, device)),
            ObsKind::Image(image) => {
                let flat: Tensor<2> = matrix(numbers, rows.len(), image.numbers(), device);
                ObsBatch::Image(flat.reshape([rows.len(), image.channels, image.height, image.width]))
            }
        }
    }

    /// Returns these rows, normalised if `stats` are given.
    fn numbers(&self, rows: &[usize], stats: Option<&ObsStats>) -> Vec<f32> {
        let width = self.rollout.obs_kind.numbers();
        let mut out = vec![0.0; rows.len() * width];
        let moves = out.len() * OF_A_MOVE;
        share(&mut out, (ROWS * width).max(1), moves, |piece, out| {
            let mut raw = vec![0.0; width];
            for (to, &row) in out.chunks_exact_mut(width.max(1)).zip(&rows[piece * ROWS..]) {
                match self.observation(row) {
                    ObsSlice::Vector(from) => raw.copy_from_slice(from),
                    ObsSlice::Image(from) => {
                        raw.iter_mut().zip(from).for_each(|(x, &byte)| *x = f32::from(byte) / 255.0);
                    }
                }
                match stats {
                    None => to.copy_from_slice(&raw),
                    Some(stats) => {
                        stats.normalize_into(&raw, to);
                        to.iter_mut().for_each(|x| *x = x.clamp(-CLIP, CLIP));
                    }
                }
            }
        });
        out
    }

    fn observation(&self, row: usize) -> ObsSlice<'_> {
        let Rollout { obs, ends, obs_kind, .. } = self.rollout;
        match self.places[row] {
            Place::Row(at) => obs.row(at, obs_kind.numbers()),
            Place::Cut(at) => ends.cut_obs.row(at, obs_kind.numbers()),
            Place::Next(at) => ends.next_obs.row(at, obs_kind.numbers()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ActionSpace, Actions, DeviceKind, nn::host};

    /// Returns three steps of two environments. The first environment terminates after its second step, and is running
    /// at the end. The second is cut off after its first step, and terminates in its last.
    fn rollout() -> Rollout {
        let mut rollout = Rollout {
            steps: 3,
            obs: vec![0.0, 10.0, 1.0, 11.0, 2.0, 12.0].into(),
            actions: Actions::Discrete(vec![0; 6]),
            log_probs: vec![0.0; 6],
            values: vec![0.0; 6],
            rewards: vec![0.0; 6],
            terminated: vec![false, false, true, false, false, true],
            truncated: vec![false, true, false, false, false, false],
            final_values: vec![0.0; 6],
            next_values: vec![0.0; 2],
            ..Rollout::new(2, 1, 0, &ActionSpace::Discrete(1))
        };
        (rollout.ends.cut_rows, rollout.ends.cut_obs) = (vec![1], vec![99.0].into());
        rollout.ends.next_obs = vec![3.0, 0.0].into();
        rollout
    }

    #[test]
    fn each_step_leads_to_the_next_observation_or_the_last_of_its_episode() {
        let rollout = rollout();
        let arrivals = Arrivals::of(&rollout).expect("complete");
        let raw = arrivals.numbers(&(0..6).collect::<Vec<_>>(), None);
        assert_eq!(raw, [1.0, 99.0, 2.0, 12.0, 3.0, 12.0]);
        let lacking = Rollout { ends: crate::EndStates::new(&ObsKind::Vector(1)), ..rollout };
        assert!(Arrivals::of(&lacking).expect_err("incomplete").to_string().contains("next_obs"));
    }

    #[test]
    fn observations_are_normalised_and_clipped() {
        let rollout = rollout();
        let arrivals = Arrivals::of(&rollout).expect("complete");
        let stats = ObsStats { mean: vec![2.0], inv_std: vec![0.5] };
        let ObsBatch::Vector(x) = arrivals.batch(&[0, 1, 4], &stats, &DeviceKind::Flex.plain()) else {
            panic!("vectors");
        };
        assert_eq!(host(x).expect("readable"), [-0.5, 5.0, 0.5]);
        let mut normalizer = ObsNormalizer::new(1);
        arrivals.add_to(&mut normalizer);
        assert!((normalizer.stats.mean[0] - 129.0 / 6.0).abs() < 1e-2, "{:?}", normalizer.stats);
    }
}
