//! The frozen skill model behind SCORE.

use super::decoder::DecoderRows;
use super::{PriorKind, ScoreConfig, decoder_kl, row_weights, unsquashed};
use crate::file::TensorFile;
use crate::nn::{HostDist, scalar};
use crate::norm::{ObsNormalizer, ObsStats, put_obs_stats};
use crate::policy::{Actor, Policy, SkillSource};
use crate::skill::{Prior, SkillDescription, SkillModel};
use crate::{Actions, DeviceKind, FileError, LearnError, ObsSlice, PolicyOutput, PolicySpec};
use rand::Rng;
use std::sync::Arc;

/// A skill model's decoder and prior, which do not learn any more.
#[derive(Clone, Debug)]
pub(crate) struct FrozenSkill {
    pub(crate) config: ScoreConfig,
    pub(crate) description: SkillDescription,
    decoder: Actor,
    prior: Actor,
    /// How decoder and prior see observations, and the policy that is tied to them.
    stats: Option<Arc<ObsStats>>,
}

/// The frozen normaliser in a checkpoint.
const STATS: &str = "skill.obs_norm";

/// How the networks of a learner see observations now: through the frozen normaliser of its skill model if that has
/// one, else through its own running one, else raw.
pub(crate) fn present_stats(skill: Option<&FrozenSkill>, running: Option<&ObsNormalizer>) -> Option<Arc<ObsStats>> {
    let frozen = skill.and_then(|skill| skill.stats.clone());
    frozen.or_else(|| running.map(|normalizer| Arc::new(normalizer.snapshot())))
}

impl FrozenSkill {
    /// `model`, used as `config` says.
    pub(crate) fn new(config: ScoreConfig, model: &SkillModel) -> Self {
        Self {
            config,
            description: model.description.clone(),
            decoder: model.nets.decoder.clone(),
            prior: model.nets.prior.clone(),
            stats: model.stats.clone(),
        }
    }

    /// Networks of the right sizes, to be filled by [`Self::take`] from `file`, a checkpoint of a policy of `spec`;
    /// `None` if it was of a learner without skills.
    pub(crate) fn described(
        config: Option<ScoreConfig>,
        description: Option<SkillDescription>,
        spec: PolicySpec,
        file: &TensorFile,
        device: DeviceKind,
    ) -> Result<Option<Self>, FileError> {
        let Some((config, description)) = config.zip(description) else { return Ok(None) };
        description.check_actors(file)?;
        let (decoder, prior) = description.actors(device).map_err(|e| file.learner(e))?;
        let skill = Self { config, description, decoder, prior, stats: None };
        let tied = skill.spec();
        if tied != spec {
            return Err(file.format(format!("the policy is {spec:?}, but its skill model makes it {tied:?}")));
        }
        Ok(Some(skill))
    }

    /// Whether the policy's layers are those of the decoder, and not those that the learner's settings describe.
    pub(crate) fn is_copied(&self) -> bool {
        self.config.init_from_decoder
    }

    /// Adds the weights of decoder and prior to a file, and their normaliser.
    pub(crate) fn put(&self, file: &mut TensorFile) -> Result<(), FileError> {
        if let Some(stats) = &self.stats {
            put_obs_stats(file, STATS, stats);
        }
        file.put_network("decoder", &self.decoder)?;
        file.put_network("prior", &self.prior)
    }

    /// Takes the weights of decoder and prior out of a file, and their normaliser.
    pub(crate) fn take(&mut self, file: &mut TensorFile, device: DeviceKind) -> Result<(), FileError> {
        self.stats = self.description.take_stats(file, STATS)?;
        file.take_network("decoder", &mut self.decoder, &device.plain())?;
        file.take_network("prior", &mut self.prior, &device.plain())
    }

    /// What a policy tied to this skill model reads and does.
    pub(crate) fn spec(&self) -> PolicySpec {
        PolicySpec {
            obs: self.description.observation,
            latent: if self.config.condition { self.latent() } else { 0 },
            action_space: self.description.action_space,
        }
    }

    /// Width of a skill.
    pub(crate) fn latent(&self) -> usize {
        self.description.config.latent
    }

    /// Where skills come from, by [`ScoreConfig::prior`].
    pub(crate) fn prior(&self, device: DeviceKind) -> Prior {
        let (latent, tanh) = (self.latent(), self.description.config.tanh_latent);
        match self.config.prior {
            PriorKind::StandardNormal => Prior::standard_normal(latent, tanh),
            PriorKind::Learned => {
                let (stats, observation) = (self.stats.clone(), self.description.observation);
                Prior::learned(&self.prior, stats, observation, (latent, tanh), device.plain())
            }
        }
    }

    /// Prior and decoder with the horizon and the draw, as a policy needs them in play.
    pub(crate) fn source(&self, device: DeviceKind) -> SkillSource {
        let (horizon, draw) = (self.config.horizon, self.config.skill_draw);
        SkillSource { prior: self.prior(device), decoder: self.decoder_policy(device), horizon, draw }
    }

    fn decoder_policy(&self, device: DeviceKind) -> Policy {
        let widths = (self.description.observation, self.latent());
        Policy::new(&self.decoder, None, self.stats.clone(), self.description.action_space, widths, device.plain())
    }

    /// The copy of the decoder that a policy starts as, if it shall. `norm_obs`: the learner would normalise observations
    /// itself.
    pub(crate) fn copy(&self, norm_obs: bool) -> Result<Option<Actor>, LearnError> {
        self.config.validate()?;
        self.config.check_space(self.description.action_space)?;
        if norm_obs && self.description.config.norm_obs {
            let text = "norm_obs does not go with a skill model that normalises observations: the policy sees them \
                        through the same frozen normaliser, not through a running one of its own";
            return Err(LearnError::Config(text.to_owned()));
        }
        if !self.config.init_from_decoder {
            return Ok(None);
        }
        if norm_obs {
            let text = "norm_obs does not go with score init_from_decoder: the decoder reads raw observations; a skill \
                        model with norm_obs of its own normalises for both";
            return Err(LearnError::Config(text.to_owned()));
        }
        Ok(Some(self.decoder.clone()))
    }

    /// Mean divergence between decoder and `policy` over `n` rows, in nats, which must be exactly 0 for a copy that is
    /// `untrained`.
    pub(crate) fn initial_kl(
        &self,
        policy: &Policy,
        untrained: bool,
        (z, obs, n): (&[f32], ObsSlice<'_>, usize),
        device: DeviceKind,
    ) -> Result<f32, LearnError> {
        if n == 0 {
            return Err(LearnError::Config("no rows to compare decoder and policy on".to_owned()));
        }
        let played = policy.forward(z, obs, n)?;
        let squashed = played.squashed;
        let mut decoded = host_dist(self.decoder_policy(device).forward(z, obs, n)?);
        if squashed {
            decoded = unsquashed(&decoded);
        }
        let rows: Vec<usize> = (0..n).collect();
        let dist = |host: HostDist| host.rows(&rows, &device.plain());
        let kl = decoder_kl(&dist(decoded), &dist(host_dist(played)), self.config.direction())?;
        let kl = scalar(kl.mean())?;
        if self.config.init_from_decoder && untrained && kl != 0.0 {
            return Err(LearnError::InitialKl { kl });
        }
        Ok(kl)
    }

    /// The decoder's distributions and α for rows of skills `z` and raw observations `obs` in which `actions` were
    /// taken; `None` if there is no penalty. `squashed`: the policy is a squashed Gaussian.
    pub(crate) fn rows<'a, R: Rng + ?Sized>(
        &self,
        (z, obs): (&[f32], impl Into<ObsSlice<'a>>),
        actions: &Actions,
        squashed: bool,
        own_samples_from: &mut R,
        device: DeviceKind,
    ) -> Result<Option<DecoderRows>, LearnError> {
        if !self.config.kl {
            return Ok(None);
        }
        let dist = host_dist(self.decoder_policy(device).forward(z, obs, actions.len())?);
        let alpha = row_weights(&self.config, &dist, actions, own_samples_from)?;
        let dist = if squashed { unsquashed(&dist) } else { dist };
        Ok(Some(DecoderRows { dist, alpha }))
    }
}

fn host_dist(output: PolicyOutput) -> HostDist {
    let log_std = (!output.log_std.is_empty()).then_some(output.log_std);
    HostDist { dim: output.space.dim(), head: output.head, log_std }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::VECTORS_AT_A_TIME;
    use crate::rng::{Streams, normal};
    use crate::skill::SkillConfig;
    use crate::{ActionSpace, ObsKind};

    #[test]
    fn a_row_left_over_is_like_any_other() {
        let device = DeviceKind::Flex;
        let (obs_dim, space) = (130, ActionSpace::Discrete(15));
        let config = SkillConfig { gru_hidden: 1, encoder_hidden: 1, ..SkillConfig::default() };
        let description = SkillDescription { config, observation: ObsKind::Vector(obs_dim), action_space: space };
        let nets = description.nets(device).expect("good settings");
        let model = SkillModel::new(description, &nets, None, device);
        let skill = FrozenSkill::new(ScoreConfig::default(), &model);
        let mut rng = Streams::new(1).stream("rows", 0);
        let n = VECTORS_AT_A_TIME + 1;
        let mut numbers = |width: usize| -> Vec<f32> { (0..n * width).map(|_| normal(&mut rng)).collect() };
        let (z, obs) = (numbers(skill.latent()), numbers(obs_dim));
        let actions = Actions::Discrete(vec![0; n]);
        let rows = skill.rows((&z, &obs), &actions, false, &mut Streams::new(1).stream("own", 0), device);
        let rows = rows.expect("finite").expect("there is a penalty");
        // The same row among others.
        let tail = |values: &[f32], width: usize| values[(n - 3) * width..].to_vec();
        let among = model.policy().forward(&tail(&z, skill.latent()), &tail(&obs, obs_dim), 3).expect("finite");
        assert_eq!(rows.dist.head.len(), n * 15);
        assert_eq!(rows.dist.head[(n - 1) * 15..], among.head[2 * 15..]);
    }
}
