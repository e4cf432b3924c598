//! Values of the last states: where episodes were cut off and where the rollout stopped.

use super::Rollout;
use crate::{LearnError, Policy};

impl Rollout {
    /// Fills [`Self::final_values`] and [`Self::next_values`] with `policy`'s values of the [`Self::ends`], all in
    /// one batch, as an alternative to one call per tick. Values that are never read become 0.
    ///
    /// # Errors
    /// As [`Self::check`]; [`LearnError::Shape`] or [`LearnError::Config`] if the states do not fit the policy.
    pub fn bootstrap(&mut self, policy: &Policy) -> Result<(), LearnError> {
        let rows = self.rows();
        self.final_values = vec![0.0; rows];
        self.next_values = vec![0.0; self.envs];
        self.check()?;
        let (width, latent) = (self.obs_kind.numbers(), self.latent);
        let done = self.done();
        let going_on = |&env: &usize| rows == 0 || !done[rows - self.envs + env];
        let running: Vec<usize> = (0..self.envs).filter(going_on).collect();
        let ends = &self.ends;
        ends.next_obs.as_slice().check_size("rollout ends next_obs", &self.obs_kind, self.envs)?;
        LearnError::check("rollout ends next_z", self.envs * latent, ends.next_z.len())?;
        let (mut obs, mut z, mut left) = (ends.cut_obs.clone(), ends.cut_z.clone(), ends.cut_left.clone());
        for &env in &running {
            obs.push(ends.next_obs.row(env, width))?;
            z.extend_from_slice(&ends.next_z[env * latent..(env + 1) * latent]);
            left.extend(ends.next_left.get(env));
        }
        let cuts = ends.cut_rows.len();
        let values = policy.values_held(&z, &left, &obs, cuts + running.len())?;
        for (&row, &value) in ends.cut_rows.iter().zip(&values) {
            self.final_values[row] = value;
        }
        for (&env, &value) in running.iter().zip(&values[cuts..]) {
            self.next_values[env] = value;
        }
        Ok(())
    }
}
