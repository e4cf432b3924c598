//! Checks that a rollout is consistent and fits a learner.

use super::Rollout;
use crate::{LearnError, PolicySpec};

impl Rollout {
    /// Checks that all lengths fit T and B, and that [`EndStates::cut_rows`](super::EndStates::cut_rows) ascend and
    /// are rows of this rollout.
    ///
    /// # Errors
    /// [`LearnError::Shape`] names the first length that does not; [`LearnError::Config`] names a row.
    pub fn check(&self) -> Result<(), LearnError> {
        self.obs.as_slice().check_size("rollout obs", &self.obs_kind, self.rows())?;
        self.check_beside_obs()
    }

    /// Does [`Self::check`] for a rollout whose observations are kept elsewhere.
    pub(super) fn check_beside_obs(&self) -> Result<(), LearnError> {
        let (rows, cuts) = (self.rows(), self.ends.cut_rows.len());
        self.ends.cut_obs.as_slice().check_size("rollout ends cut_obs", &self.obs_kind, cuts)?;
        for (name, expected, found) in [
            ("rollout z", rows * self.latent, self.z.len()),
            ("rollout actions", rows, self.actions.len()),
            ("rollout log_probs", rows, self.log_probs.len()),
            ("rollout values", rows, self.values.len()),
            ("rollout rewards", rows, self.rewards.len()),
            ("rollout terminated", rows, self.terminated.len()),
            ("rollout truncated", rows, self.truncated.len()),
            ("rollout final_values", rows, self.final_values.len()),
            ("rollout next_values", self.envs, self.next_values.len()),
            ("rollout ends cut_z", cuts * self.latent, self.ends.cut_z.len()),
        ] {
            LearnError::check(name, expected, found)?;
        }
        for (name, expected, left) in [
            ("rollout left", rows, &self.left),
            ("rollout ends cut_left", cuts, &self.ends.cut_left),
            ("rollout ends next_left", self.envs, &self.ends.next_left),
        ] {
            if !left.is_empty() {
                LearnError::check(name, expected, left.len())?;
            }
        }
        let cut_rows = &self.ends.cut_rows;
        if let Some(row) = cut_rows.iter().find(|row| **row >= rows) {
            return Err(LearnError::Config(format!("rollout ends: row {row} is listed, but there are {rows} rows")));
        }
        if let Some(pair) = cut_rows.windows(2).find(|pair| pair[0] >= pair[1]) {
            let text = format!("rollout ends: row {} is listed after row {}: they must ascend", pair[1], pair[0]);
            return Err(LearnError::Config(text));
        }
        Ok(())
    }

    /// Checks that a learner of `spec` can learn from this rollout with skills of width `latent`. It must fit and not
    /// be empty, and every observation, skill and number that is learned from must be finite.
    ///
    /// # Errors
    /// As [`Self::check`]; [`LearnError::Action`] if the actions do not fit; [`LearnError::Input`] names the first row
    /// that is not finite; [`LearnError::Config`] if there are no rows.
    pub(crate) fn check_for(&self, spec: &PolicySpec, latent: usize) -> Result<(), LearnError> {
        self.check()?;
        spec.action_space.check(&self.actions)?;
        spec.obs.same_as(&self.obs_kind, "the rollout")?;
        LearnError::check("latent of the rollout", latent, self.latent)?;
        if self.rows() == 0 {
            return Err(LearnError::Config("the rollout is empty".to_owned()));
        }
        let ends = &self.ends;
        for (name, obs) in [
            ("rollout obs", &self.obs),
            ("rollout ends cut_obs", &ends.cut_obs),
            ("rollout ends next_obs", &ends.next_obs),
        ] {
            obs.as_slice().check_finite(name, self.obs_kind.numbers())?;
        }
        for (name, width, values) in [
            ("rollout z", self.latent, &self.z),
            ("rollout left", 1, &self.left),
            ("rollout rewards", 1, &self.rewards),
            ("rollout ends cut_z", self.latent, &ends.cut_z),
            ("rollout ends next_z", self.latent, &ends.next_z),
        ] {
            LearnError::check_finite(name, width, values)?;
        }
        Ok(())
    }
}
