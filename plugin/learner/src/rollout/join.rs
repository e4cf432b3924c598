//! Rollouts of several Worlds as one.

use super::Rollout;
use crate::{ActionSpace, LearnError, Observations};

impl Rollout {
    /// Puts rollouts of the same length side by side: the environments of the first, then those of the second, ... A
    /// single one stays as it is.
    ///
    /// # Errors
    /// [`LearnError::Config`] for no parts; [`LearnError::Shape`], [`LearnError::Config`] or [`LearnError::Action`] if they
    /// do not fit together.
    pub fn join(mut parts: Vec<Self>) -> Result<Self, LearnError> {
        for part in &parts {
            part.check()?;
        }
        if parts.len() == 1 {
            return Ok(parts.remove(0));
        }
        let Some(first) = parts.first() else {
            return Err(LearnError::Config("no rollouts to join".to_owned()));
        };
        let (kind, width) = (first.obs_kind, first.obs_kind.numbers());
        let mut all =
            Self { actions: first.actions.clone(), ..Self::new(0, kind, first.latent, &ActionSpace::Discrete(0)) };
        all.actions.clear();
        all.obs = Observations::with_capacity(&kind, parts.iter().map(Self::rows).sum());
        all.steps = first.steps;
        for part in &parts {
            LearnError::check("steps of a joined rollout", first.steps, part.steps)?;
            kind.same_as(&part.obs_kind, "a joined rollout")?;
            LearnError::check("latent of a joined rollout", first.latent, part.latent)?;
            all.envs += part.envs;
            all.next_values.extend_from_slice(&part.next_values);
            all.ends.next_obs.push(&part.ends.next_obs)?;
            all.ends.next_z.extend_from_slice(&part.ends.next_z);
        }
        for t in 0..first.steps {
            for part in &parts {
                let rows = t * part.envs..(t + 1) * part.envs;
                all.actions.extend_rows(&part.actions, rows.start, rows.end)?;
                all.obs.push(part.obs.rows(rows.clone(), width))?;
                all.z.extend_from_slice(&part.z[rows.start * part.latent..rows.end * part.latent]);
                all.log_probs.extend_from_slice(&part.log_probs[rows.clone()]);
                all.values.extend_from_slice(&part.values[rows.clone()]);
                all.rewards.extend_from_slice(&part.rewards[rows.clone()]);
                all.terminated.extend_from_slice(&part.terminated[rows.clone()]);
                all.truncated.extend_from_slice(&part.truncated[rows.clone()]);
                all.final_values.extend_from_slice(&part.final_values[rows]);
            }
        }
        all.join_cuts(&parts)?;
        Ok(all)
    }

    /// The cut episodes of all parts, in ascending order of their joined rows.
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
            self.ends.cut_z.extend_from_slice(&part.ends.cut_z[i * self.latent..(i + 1) * self.latent]);
        }
        Ok(())
    }
}
