//! The frozen skill model behind SCORE-PPO.

use super::batch::DecoderRows;
use super::{PolicySpec, PpoLearner, Rollout};
use crate::nn::{HostDist, matrix, scalar};
use crate::policy::{Actor, Policy, joined_rows};
use crate::score::{ScoreConfig, decoder_kl, row_weights};
use crate::skill::SkillDescription;
use crate::{LearnError, PolicyOutput};

/// Rows that the frozen decoder reads at a time.
const DECODER_CHUNK: usize = 2048;

/// A skill model's decoder and prior, which do not learn any more.
#[derive(Clone, Debug)]
pub(super) struct FrozenSkill {
    pub(super) config: ScoreConfig,
    pub(super) description: SkillDescription,
    pub(super) decoder: Actor,
    pub(super) prior: Actor,
}

impl PpoLearner {
    /// Mean divergence between decoder and policy over `n` rows, in nats: exactly 0 for a policy that is still a copy
    /// of the decoder. `None` without a skill model.
    ///
    /// # Errors
    /// [`LearnError::InitialKl`] if the policy should be a copy (no update was done, and
    /// [`ScoreConfig::init_from_decoder`]) and the divergence is not exactly 0; [`LearnError::Shape`].
    pub fn initial_kl(&self, z: &[f32], obs: &[f32], n: usize) -> Result<Option<f32>, LearnError> {
        let Some(skill) = &self.skill else { return Ok(None) };
        if n == 0 {
            return Err(LearnError::Config("no rows to compare decoder and policy on".to_owned()));
        }
        let policy = self.policy();
        let played = policy.forward(z, obs, n)?;
        let copy = Policy::new(
            &skill.decoder,
            None,
            None,
            self.spec.action_space,
            (self.spec.obs_dim, skill.description.config.latent),
            self.device.plain(),
        );
        let decoded = copy.forward(z, obs, n)?;
        let device = self.device.plain();
        let rows: Vec<usize> = (0..n).collect();
        let dist = |output: PolicyOutput| {
            let log_std = (!output.log_std.is_empty()).then_some(output.log_std);
            let host = HostDist { dim: self.spec.action_space.dim(), head: output.head, log_std };
            host.rows(&rows, &device)
        };
        let kl = decoder_kl(&dist(decoded), &dist(played), skill.config.direction())?;
        let kl = scalar(kl.mean())?;
        if skill.config.init_from_decoder && self.updates == 0 && kl != 0.0 {
            return Err(LearnError::InitialKl { kl });
        }
        Ok(Some(kl))
    }

    /// The decoder's distributions and α for the whole rollout: it is frozen, so once per update is enough.
    pub(super) fn decoder_rows(&self, rollout: &Rollout) -> Result<Option<DecoderRows>, LearnError> {
        let Some(skill) = self.skill.as_ref().filter(|skill| skill.config.kl) else {
            return Ok(None);
        };
        let (n, latent, obs_dim) = (rollout.rows(), rollout.latent, rollout.obs_dim);
        let device = self.device.plain();
        let mut dist = HostDist { dim: self.spec.action_space.dim(), head: Vec::new(), log_std: None };
        for start in (0..n).step_by(DECODER_CHUNK) {
            let rows = start..(start + DECODER_CHUNK).min(n);
            let len = rows.len();
            let inputs = joined_rows(&rollout.z, latent, &rollout.obs, obs_dim, None, rows);
            let part = skill.decoder.forward(matrix(inputs, len, latent + obs_dim, &device)).to_host()?;
            dist.head.extend(part.head);
            if let Some(stds) = part.log_std {
                dist.log_std.get_or_insert_default().extend(stds);
            }
        }
        let mut rng = self.streams.stream("score.own_samples", self.updates);
        let alpha = row_weights(&skill.config, &dist, &rollout.actions, &mut rng)?;
        Ok(Some(DecoderRows { dist, alpha }))
    }
}

impl FrozenSkill {
    /// What a policy tied to this skill model reads and does.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the skill model reads images.
    pub(super) fn spec(&self) -> Result<PolicySpec, LearnError> {
        Ok(PolicySpec {
            obs_dim: self.description.observation.vector("PPO")?,
            latent: if self.config.condition { self.description.config.latent } else { 0 },
            action_space: self.description.action_space,
        })
    }
}
