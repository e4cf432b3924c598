//! Rollouts of several Worlds as one.

use super::Rollout;
use crate::{ActionSpace, LearnError, ObsKind, Observations};

impl Rollout {
    /// Puts rollouts of the same length side by side: the environments of the first, then those of the second, ... A
    /// single one is returned unchanged.
    ///
    /// # Errors
    /// [`LearnError::Config`] for no parts; [`LearnError::Shape`], [`LearnError::Config`] or [`LearnError::Action`]
    /// if they do not fit together.
    pub fn join(mut parts: Vec<Self>) -> Result<Self, LearnError> {
        parts.iter().try_for_each(Self::check)?;
        if parts.len() == 1 {
            return Ok(parts.remove(0));
        }
        let mut all = Self::join_beside_obs(&parts)?;
        all.obs = side_by_side(&parts, &all.obs_kind)?;
        Ok(all)
    }

    /// Joins parts as [`Self::join`] does, with observations that are in `obs` already, each in its
    /// [columns](Observations::columns); observations in the parts are ignored.
    ///
    /// # Errors
    /// As [`Self::join`].
    pub fn join_around(obs: Observations, mut parts: Vec<Self>) -> Result<Self, LearnError> {
        let mut all = match parts.len() {
            1 => parts.remove(0),
            _ => Self::join_beside_obs(&parts)?,
        };
        all.obs = obs;
        all.check()?;
        Ok(all)
    }

    fn join_beside_obs(parts: &[Self]) -> Result<Self, LearnError> {
        let Some(first) = parts.first() else {
            return Err(LearnError::Config("no rollouts to join".to_owned()));
        };
        let kind = first.obs_kind;
        let mut all =
            Self { actions: first.actions.clone(), ..Self::new(0, kind, first.latent, &ActionSpace::Discrete(0)) };
        all.actions.clear();
        all.steps = first.steps;
        for part in parts {
            part.check_beside_obs()?;
            LearnError::check("steps of a joined rollout", first.steps, part.steps)?;
            kind.same_as(&part.obs_kind, "a joined rollout")?;
            LearnError::check("latent of a joined rollout", first.latent, part.latent)?;
            all.envs += part.envs;
            all.next_values.extend_from_slice(&part.next_values);
            all.ends.next_obs.push(&part.ends.next_obs)?;
            all.ends.next_z.extend_from_slice(&part.ends.next_z);
            all.ends.next_left.extend_from_slice(&part.ends.next_left);
        }
        for t in 0..first.steps {
            for part in parts {
                let rows = t * part.envs..(t + 1) * part.envs;
                all.actions.extend_rows(&part.actions, rows.start, rows.end)?;
                all.z.extend_from_slice(&part.z[rows.start * part.latent..rows.end * part.latent]);
                all.left.extend_from_slice(part.left.get(rows.clone()).unwrap_or_default());
                all.log_probs.extend_from_slice(&part.log_probs[rows.clone()]);
                all.values.extend_from_slice(&part.values[rows.clone()]);
                all.rewards.extend_from_slice(&part.rewards[rows.clone()]);
                all.terminated.extend_from_slice(&part.terminated[rows.clone()]);
                all.truncated.extend_from_slice(&part.truncated[rows.clone()]);
                all.final_values.extend_from_slice(&part.final_values[rows]);
            }
        }
        all.join_cuts(parts)?;
        Ok(all)
    }

    /// Returns the cut episodes of all parts, in ascending order of their joined rows.
    fn join_cuts(&mut self, parts: &[Self]) -> Result<(), LearnError> {
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
            self.ends.cut_rows.push(row);
            self.ends.cut_obs.push(part.ends.cut_obs.row(i, self.obs_kind.numbers()))?;
            self.ends.cut_left.extend(part.ends.cut_left.get(i));
            self.ends.cut_z.extend_from_slice(&part.ends.cut_z[i * self.latent..(i + 1) * self.latent]);
        }
        Ok(())
    }
}

/// Returns the observations of parts that fit together, tick by tick.
fn side_by_side(parts: &[Rollout], kind: &ObsKind) -> Result<Observations, LearnError> {
    let mut obs = Observations::with_capacity(kind, parts.iter().map(Rollout::rows).sum());
    for t in 0..parts.first().map_or(0, |part| part.steps) {
        for part in parts {
            obs.push(part.obs.rows(t * part.envs..(t + 1) * part.envs, kind.numbers()))?;
        }
    }
    Ok(obs)
}
