//! The steps of a rollout, tick by tick.

use super::EndStates;
use crate::{ActionSpace, Actions, LearnError, ObsKind, ObsSlice, Observations};

/// Steps of B environments over T ticks, flat and row-major: row `t * envs + b`.
#[derive(Clone, Debug, PartialEq)]
pub struct Rollout {
    /// T.
    pub steps: usize,
    /// B.
    pub envs: usize,
    /// The kind of observations.
    pub obs_kind: ObsKind,
    /// Width of a skill; may be 0.
    pub latent: usize,
    /// Raw observations, `T * B`; pixels as bytes.
    pub obs: Observations,
    /// The skill active at each step, `T * B * latent`.
    pub z: Vec<f32>,
    /// The remaining share of that skill's ticks, this one included, above 0 and up to 1, `T * B`. Empty if ticks are
    /// not counted: all skills count as newly drawn then.
    pub left: Vec<f32>,
    /// The actions taken, `T * B`.
    pub actions: Actions,
    /// Their log-probabilities when taken.
    pub log_probs: Vec<f32>,
    /// Values of the observations when seen.
    pub values: Vec<f32>,
    /// Raw rewards of the actions.
    pub rewards: Vec<f32>,
    /// True where the action ended the episode by the game's own rules.
    pub terminated: Vec<bool>,
    /// True where the episode was cut off after the action.
    pub truncated: Vec<bool>,
    /// Value of the last observation of an episode that was cut off after this step; not read elsewhere.
    pub final_values: Vec<f32>,
    /// Value of the observation after the last step of each environment (under the skill active then), `B`.
    pub next_values: Vec<f32>,
    /// The states behind `final_values` and `next_values`, for learners that keep transitions; may be left empty for PPO.
    pub ends: EndStates,
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
    /// Creates a rollout without steps.
    pub fn new(envs: usize, obs: impl Into<ObsKind>, latent: usize, space: &ActionSpace) -> Self {
        let obs_kind = obs.into();
        Self {
            steps: 0,
            envs,
            obs_kind,
            latent,
            obs: Observations::empty(&obs_kind),
            z: Vec::new(),
            left: Vec::new(),
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

    /// Returns the number of rows, T · B.
    pub fn rows(&self) -> usize {
        self.steps * self.envs
    }

    /// Returns whether any reward is not 0: otherwise there is nothing to learn from rewards.
    pub fn is_rewarded(&self) -> bool {
        self.rewards.iter().any(|&reward| reward != 0.0)
    }

    /// Removes all steps and keeps the memory.
    pub fn clear(&mut self) {
        self.steps = 0;
        self.obs.clear();
        self.actions.clear();
        for values in [
            &mut self.z,
            &mut self.left,
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
    /// under which it is valued. Environments come in ascending order within a step.
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

    /// Adds the remaining shares of the skills of the newest step, `B`.
    pub fn push_left(&mut self, left: &[f32]) {
        self.left.extend_from_slice(left);
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

    /// Returns whether an episode ended at each row, in either way.
    pub fn done(&self) -> Vec<bool> {
        self.terminated.iter().zip(&self.truncated).map(|(a, b)| *a || *b).collect()
    }
}
