//! What was played since the last update.

mod bootstrap;
mod join;

use crate::{ActionSpace, Actions, LearnError, ObsKind, ObsSlice, Observations, PolicySpec};

/// Steps of B environments over T ticks, flat and row-major: row `t * envs + b`.
#[derive(Clone, Debug, PartialEq)]
pub struct Rollout {
    /// T.
    pub steps: usize,
    /// B.
    pub envs: usize,
    /// What an observation is.
    pub obs_kind: ObsKind,
    /// Width of a skill; may be 0.
    pub latent: usize,
    /// Raw observations, `T * B`; pixels as bytes.
    pub obs: Observations,
    /// The skill active at each step, `T * B * latent`.
    pub z: Vec<f32>,
    /// The actions taken, `T * B`.
    pub actions: Actions,
    /// Their log-probabilities when taken.
    pub log_probs: Vec<f32>,
    /// Values of the observations when seen.
    pub values: Vec<f32>,
    /// Raw rewards of the actions.
    pub rewards: Vec<f32>,
    /// Whether the action ended the episode by the game's own rules.
    pub terminated: Vec<bool>,
    /// Whether the episode was cut off after the action.
    pub truncated: Vec<bool>,
    /// Value of the last observation of an episode that was cut off after this step; not read elsewhere.
    pub final_values: Vec<f32>,
    /// Value of the observation after the last step of each environment (under the skill active then), `B`.
    pub next_values: Vec<f32>,
    /// The states behind `final_values` and `next_values`, for learners that keep transitions; may be left empty for PPO.
    pub ends: EndStates,
}

/// States that no row of a rollout shows: where episodes were cut off, and where the rollout stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct EndStates {
    /// Rows that cut an episode off without terminating it, ascending.
    pub cut_rows: Vec<usize>,
    /// Last observation of each of those episodes.
    pub cut_obs: Observations,
    /// The skill under which that observation is judged, `cut_rows * latent`.
    pub cut_z: Vec<f32>,
    /// Observation after the last row of each environment, `B`; zeros where that row ended an episode.
    pub next_obs: Observations,
    /// The skill active there, `B * latent`.
    pub next_z: Vec<f32>,
}

impl EndStates {
    /// No states yet.
    pub fn new(kind: &ObsKind) -> Self {
        let none = || Observations::empty(kind);
        Self { cut_rows: Vec::new(), cut_obs: none(), cut_z: Vec::new(), next_obs: none(), next_z: Vec::new() }
    }

    fn clear(&mut self) {
        self.cut_rows.clear();
        self.cut_obs.clear();
        self.cut_z.clear();
        self.next_obs.clear();
        self.next_z.clear();
    }
}

/// One tick of all environments of a [`Rollout`].
#[derive(Clone, Copy, Debug)]
pub struct RolloutStep<'a> {
    /// `B` observations.
    pub obs: ObsSlice<'a>,
    /// `B * latent`.
    pub z: &'a [f32],
    /// `B`.
    pub actions: &'a Actions,
    /// `B`.
    pub log_probs: &'a [f32],
    /// `B`.
    pub values: &'a [f32],
    /// `B`.
    pub rewards: &'a [f32],
    /// `B`.
    pub terminated: &'a [bool],
    /// `B`.
    pub truncated: &'a [bool],
    /// `B`; read only where cut off and not terminated.
    pub final_values: &'a [f32],
}

impl Rollout {
    /// No steps yet.
    pub fn new(envs: usize, obs: impl Into<ObsKind>, latent: usize, space: &ActionSpace) -> Self {
        let obs_kind = obs.into();
        Self {
            steps: 0,
            envs,
            obs_kind,
            latent,
            obs: Observations::empty(&obs_kind),
            z: Vec::new(),
            actions: Actions::empty(space),
            log_probs: Vec::new(),
            values: Vec::new(),
            rewards: Vec::new(),
            terminated: Vec::new(),
            truncated: Vec::new(),
            final_values: Vec::new(),
            next_values: Vec::new(),
            ends: EndStates::new(&obs_kind),
        }
    }

    /// Number of rows, T · B.
    pub fn rows(&self) -> usize {
        self.steps * self.envs
    }

    /// Forgets all steps and keeps the memory.
    pub fn clear(&mut self) {
        self.steps = 0;
        self.obs.clear();
        self.actions.clear();
        for values in [
            &mut self.z,
            &mut self.log_probs,
            &mut self.values,
            &mut self.rewards,
            &mut self.final_values,
            &mut self.next_values,
        ] {
            values.clear();
        }
        self.terminated.clear();
        self.truncated.clear();
        self.ends.clear();
    }

    /// Keeps the last observation of an episode of environment `env` that the newest step has cut off, with the skill
    /// under which it is judged. Environments come in ascending order within a step.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the observation is of another kind.
    ///
    /// # Panics
    /// If no step was pushed yet.
    pub fn push_cut<'a>(&mut self, env: usize, obs: impl Into<ObsSlice<'a>>, z: &[f32]) -> Result<(), LearnError> {
        self.ends.cut_obs.push(obs)?;
        self.ends.cut_rows.push((self.steps - 1) * self.envs + env);
        self.ends.cut_z.extend_from_slice(z);
        Ok(())
    }

    /// Adds one tick.
    ///
    /// # Errors
    /// [`LearnError::Action`] or [`LearnError::Config`] if actions or observations are of another kind. Lengths are checked
    /// when the rollout is used.
    pub fn push_step(&mut self, step: RolloutStep<'_>) -> Result<(), LearnError> {
        self.actions.extend_rows(step.actions, 0, step.actions.len())?;
        self.obs.push(step.obs)?;
        self.z.extend_from_slice(step.z);
        self.log_probs.extend_from_slice(step.log_probs);
        self.values.extend_from_slice(step.values);
        self.rewards.extend_from_slice(step.rewards);
        self.terminated.extend_from_slice(step.terminated);
        self.truncated.extend_from_slice(step.truncated);
        self.final_values.extend_from_slice(step.final_values);
        self.steps += 1;
        Ok(())
    }

    /// `Ok` if all lengths fit T and B, and [`EndStates::cut_rows`] ascend and are rows of this rollout.
    ///
    /// # Errors
    /// [`LearnError::Shape`] names the first length that does not; [`LearnError::Config`] names a row.
    pub fn check(&self) -> Result<(), LearnError> {
        let (rows, cuts) = (self.rows(), self.ends.cut_rows.len());
        self.obs.as_slice().check_size("rollout obs", &self.obs_kind, rows)?;
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

    /// `Ok` if a learner of `spec` can learn from this rollout with skills of width `latent`: it fits, it is not empty,
    /// and every observation, skill and number that is learned from is finite.
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
            ("rollout rewards", 1, &self.rewards),
            ("rollout ends cut_z", self.latent, &ends.cut_z),
            ("rollout ends next_z", self.latent, &ends.next_z),
        ] {
            LearnError::check_finite(name, width, values)?;
        }
        Ok(())
    }

    /// Whether an episode ended at each row, in either way.
    pub fn done(&self) -> Vec<bool> {
        self.terminated.iter().zip(&self.truncated).map(|(a, b)| *a || *b).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(envs: usize, base: f32) -> Rollout {
        let mut rollout = Rollout::new(envs, 1, 0, &ActionSpace::Discrete(9));
        for t in 0..2 {
            let row: Vec<f32> = (0..envs).map(|b| base + (t * 10 + b) as f32).collect();
            let actions = Actions::Discrete(vec![t as u32; envs]);
            let flags = vec![false; envs];
            let step = RolloutStep {
                obs: (&row).into(),
                z: &[],
                actions: &actions,
                log_probs: &row,
                values: &row,
                rewards: &row,
                terminated: &flags,
                truncated: &flags,
                final_values: &row,
            };
            rollout.push_step(step).expect("discrete");
        }
        rollout.push_cut(envs - 1, &[base], &[]).expect("vectors");
        rollout.next_values = vec![base; envs];
        rollout.ends.next_obs = vec![base; envs].into();
        rollout
    }

    #[test]
    fn joined_rollouts_lie_side_by_side() {
        let joined = Rollout::join(vec![part(2, 0.0), part(1, 100.0)]).expect("they fit");
        assert_eq!((joined.steps, joined.envs), (2, 3));
        assert_eq!(joined.rewards, [0.0, 1.0, 100.0, 10.0, 11.0, 110.0]);
        assert_eq!(joined.next_values, [0.0, 0.0, 100.0]);
        assert!(joined.check().is_ok());
        assert_eq!(joined.ends.next_obs, joined.next_values.into());
        assert_eq!((joined.ends.cut_rows, joined.ends.cut_obs), (vec![4, 5], vec![0.0, 100.0].into()));
    }

    #[test]
    fn a_wrong_length_is_named() {
        let mut rollout = part(2, 0.0);
        rollout.rewards.pop();
        assert!(rollout.check().expect_err("too short").to_string().contains("rewards"));
    }

    #[test]
    fn rollouts_with_ends_that_do_not_fit_are_not_joined() {
        let after = |change: fn(&mut EndStates)| {
            let mut rollout = part(2, 0.0);
            change(&mut rollout.ends);
            Rollout::join(vec![part(1, 5.0), rollout]).expect_err("does not fit").to_string()
        };
        assert!(after(|ends| ends.cut_obs.clear()).contains("cut_obs"));
        assert!(after(|ends| ends.cut_z.push(1.0)).contains("cut_z"));
        assert!(after(|ends| ends.cut_rows[0] = 4).contains("row 4"));
        assert!(after(|ends| (ends.cut_rows, ends.cut_obs) = (vec![3, 1], vec![0.0; 2].into())).contains("ascend"));
        let without = Rollout { ends: EndStates::new(&ObsKind::Vector(1)), ..part(2, 0.0) };
        assert!(Rollout::join(vec![without.clone(), without]).is_ok(), "PPO needs none");
    }
}
