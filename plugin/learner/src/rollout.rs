//! What was played since the last update.

use crate::{ActionSpace, Actions, LearnError, PolicySpec};

/// Steps of B environments over T ticks, flat and row-major: row `t * envs + b`.
#[derive(Clone, Debug, PartialEq)]
pub struct Rollout {
    /// T.
    pub steps: usize,
    /// B.
    pub envs: usize,
    /// Width of an observation.
    pub obs_dim: usize,
    /// Width of a skill; may be 0.
    pub latent: usize,
    /// Raw observations, `T * B * obs_dim`.
    pub obs: Vec<f32>,
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
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EndStates {
    /// Rows that cut an episode off without terminating it, ascending.
    pub cut_rows: Vec<usize>,
    /// Last observation of each of those episodes, `cut_rows * obs_dim`.
    pub cut_obs: Vec<f32>,
    /// The skill under which that observation is judged, `cut_rows * latent`.
    pub cut_z: Vec<f32>,
    /// Observation after the last row of each environment, `B * obs_dim`; zeros where that row ended an episode.
    pub next_obs: Vec<f32>,
    /// The skill active there, `B * latent`.
    pub next_z: Vec<f32>,
}

impl EndStates {
    fn clear(&mut self) {
        self.cut_rows.clear();
        for values in [&mut self.cut_obs, &mut self.cut_z, &mut self.next_obs, &mut self.next_z] {
            values.clear();
        }
    }
}

/// One tick of all environments of a [`Rollout`].
#[derive(Clone, Copy, Debug)]
pub struct RolloutStep<'a> {
    /// `B * obs_dim`.
    pub obs: &'a [f32],
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
    pub fn new(envs: usize, obs_dim: usize, latent: usize, space: &ActionSpace) -> Self {
        Self {
            steps: 0,
            envs,
            obs_dim,
            latent,
            obs: Vec::new(),
            z: Vec::new(),
            actions: Actions::empty(space),
            log_probs: Vec::new(),
            values: Vec::new(),
            rewards: Vec::new(),
            terminated: Vec::new(),
            truncated: Vec::new(),
            final_values: Vec::new(),
            next_values: Vec::new(),
            ends: EndStates::default(),
        }
    }

    /// Number of rows, T · B.
    pub fn rows(&self) -> usize {
        self.steps * self.envs
    }

    /// Forgets all steps and keeps the memory.
    pub fn clear(&mut self) {
        self.steps = 0;
        self.actions.clear();
        for values in [
            &mut self.obs,
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
    /// # Panics
    /// If no step was pushed yet.
    pub fn push_cut(&mut self, env: usize, obs: &[f32], z: &[f32]) {
        self.ends.cut_rows.push((self.steps - 1) * self.envs + env);
        self.ends.cut_obs.extend_from_slice(obs);
        self.ends.cut_z.extend_from_slice(z);
    }

    /// Adds one tick.
    ///
    /// # Errors
    /// [`LearnError::Action`] if the actions are of another kind. Lengths are checked when the rollout is used.
    pub fn push_step(&mut self, step: RolloutStep<'_>) -> Result<(), LearnError> {
        self.actions.extend_rows(step.actions, 0, step.actions.len())?;
        self.obs.extend_from_slice(step.obs);
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

    /// Puts rollouts of the same length side by side: the environments of the first, then those of the second, ...
    ///
    /// # Errors
    /// [`LearnError::Config`] for no parts; [`LearnError::Shape`] or [`LearnError::Action`] if they do not fit together.
    pub fn join(parts: &[Self]) -> Result<Self, LearnError> {
        let Some(first) = parts.first() else {
            return Err(LearnError::Config("no rollouts to join".to_owned()));
        };
        let mut all = Self {
            actions: first.actions.clone(),
            ..Self::new(0, first.obs_dim, first.latent, &ActionSpace::Discrete(0))
        };
        all.actions.clear();
        all.steps = first.steps;
        for part in parts {
            part.check()?;
            LearnError::check("steps of a joined rollout", first.steps, part.steps)?;
            LearnError::check("obs_dim of a joined rollout", first.obs_dim, part.obs_dim)?;
            LearnError::check("latent of a joined rollout", first.latent, part.latent)?;
            all.envs += part.envs;
            all.next_values.extend_from_slice(&part.next_values);
            all.ends.next_obs.extend_from_slice(&part.ends.next_obs);
            all.ends.next_z.extend_from_slice(&part.ends.next_z);
        }
        for t in 0..first.steps {
            for part in parts {
                let rows = t * part.envs..(t + 1) * part.envs;
                let wide = |width: usize| rows.start * width..rows.end * width;
                all.actions.extend_rows(&part.actions, rows.start, rows.end)?;
                all.obs.extend_from_slice(&part.obs[wide(part.obs_dim)]);
                all.z.extend_from_slice(&part.z[wide(part.latent)]);
                all.log_probs.extend_from_slice(&part.log_probs[rows.clone()]);
                all.values.extend_from_slice(&part.values[rows.clone()]);
                all.rewards.extend_from_slice(&part.rewards[rows.clone()]);
                all.terminated.extend_from_slice(&part.terminated[rows.clone()]);
                all.truncated.extend_from_slice(&part.truncated[rows.clone()]);
                all.final_values.extend_from_slice(&part.final_values[rows]);
            }
        }
        all.join_cuts(parts);
        Ok(all)
    }

    /// The cut episodes of all parts, in ascending order of their joined rows.
    fn join_cuts(&mut self, parts: &[Self]) {
        let mut cuts = Vec::new();
        let mut offset = 0;
        for part in parts {
            for (i, &row) in part.ends.cut_rows.iter().enumerate() {
                let joined = row / part.envs * self.envs + offset + row % part.envs;
                cuts.push((joined, part, i));
            }
            offset += part.envs;
        }
        cuts.sort_by_key(|(row, ..)| *row);
        for (row, part, i) in cuts {
            let (obs_dim, latent) = (self.obs_dim, self.latent);
            self.ends.cut_rows.push(row);
            self.ends.cut_obs.extend_from_slice(&part.ends.cut_obs[i * obs_dim..(i + 1) * obs_dim]);
            self.ends.cut_z.extend_from_slice(&part.ends.cut_z[i * latent..(i + 1) * latent]);
        }
    }

    /// `Ok` if all lengths fit T and B, and [`EndStates::cut_rows`] ascend and are rows of this rollout.
    ///
    /// # Errors
    /// [`LearnError::Shape`] names the first length that does not; [`LearnError::Config`] names a row.
    pub fn check(&self) -> Result<(), LearnError> {
        let (rows, cuts) = (self.rows(), self.ends.cut_rows.len());
        for (name, expected, found) in [
            ("rollout obs", rows * self.obs_dim, self.obs.len()),
            ("rollout z", rows * self.latent, self.z.len()),
            ("rollout actions", rows, self.actions.len()),
            ("rollout log_probs", rows, self.log_probs.len()),
            ("rollout values", rows, self.values.len()),
            ("rollout rewards", rows, self.rewards.len()),
            ("rollout terminated", rows, self.terminated.len()),
            ("rollout truncated", rows, self.truncated.len()),
            ("rollout final_values", rows, self.final_values.len()),
            ("rollout next_values", self.envs, self.next_values.len()),
            ("rollout ends cut_obs", cuts * self.obs_dim, self.ends.cut_obs.len()),
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
        LearnError::check("obs_dim of the rollout", spec.obs_dim, self.obs_dim)?;
        LearnError::check("latent of the rollout", latent, self.latent)?;
        if self.rows() == 0 {
            return Err(LearnError::Config("the rollout is empty".to_owned()));
        }
        for (name, width, values) in [
            ("rollout obs", self.obs_dim, &self.obs),
            ("rollout z", self.latent, &self.z),
            ("rollout rewards", 1, &self.rewards),
            ("rollout ends cut_obs", self.obs_dim, &self.ends.cut_obs),
            ("rollout ends cut_z", self.latent, &self.ends.cut_z),
            ("rollout ends next_obs", self.obs_dim, &self.ends.next_obs),
            ("rollout ends next_z", self.latent, &self.ends.next_z),
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
                obs: &row,
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
        rollout.push_cut(envs - 1, &[base], &[]);
        rollout.next_values = vec![base; envs];
        rollout.ends.next_obs = vec![base; envs];
        rollout
    }

    #[test]
    fn joined_rollouts_lie_side_by_side() {
        let joined = Rollout::join(&[part(2, 0.0), part(1, 100.0)]).expect("they fit");
        assert_eq!((joined.steps, joined.envs), (2, 3));
        assert_eq!(joined.rewards, [0.0, 1.0, 100.0, 10.0, 11.0, 110.0]);
        assert_eq!(joined.next_values, [0.0, 0.0, 100.0]);
        assert_eq!((&joined.ends.cut_rows[..], &joined.ends.cut_obs[..]), (&[4, 5][..], &[0.0, 100.0][..]));
        assert_eq!(joined.ends.next_obs, joined.next_values);
        assert!(joined.check().is_ok());
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
            Rollout::join(&[part(1, 5.0), rollout]).expect_err("does not fit").to_string()
        };
        assert!(after(|ends| ends.cut_obs.clear()).contains("cut_obs"));
        assert!(after(|ends| ends.cut_z.push(1.0)).contains("cut_z"));
        assert!(after(|ends| ends.cut_rows[0] = 4).contains("row 4"));
        assert!(after(|ends| (ends.cut_rows, ends.cut_obs) = (vec![3, 1], vec![0.0; 2])).contains("ascend"));
        let without = Rollout { ends: EndStates::default(), ..part(2, 0.0) };
        assert!(Rollout::join(&[without.clone(), without]).is_ok(), "PPO needs none");
    }
}
