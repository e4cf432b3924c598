//! The learner: PPO, and SCORE-PPO if it is given a skill model.

use super::batch::Prepared;
use super::update::{StepMetrics, gradient_step};
use super::{PpoConfig, PpoNets, UpdateMetrics, explained_variance, gae};
use crate::nn::{Adam, AdamConfig, ImageNet, tracked};
use crate::norm::{ObsNormalizer, RewardNormalizer};
use crate::policy::{Actor, Critic, Policy, SkillSource, StdKind};
use crate::rng::{Streams, shuffle};
use crate::score::{DecoderRows, FrozenSkill, ScoreConfig, present_stats};
use crate::skill::{Prior, SkillModel};
use crate::{DeviceKind, LearnError, ObsKind, ObsSlice, Observations, PolicySpec, Rollout};
use burn::tensor::Device;

/// Improves a policy from rollouts.
///
/// Without a skill model this is PPO; with one it is SCORE-PPO (see [`crate::score`]). The numbers depend only on the
/// settings, the seed and the rollouts.
#[derive(Debug)]
pub struct PpoLearner {
    pub(super) config: PpoConfig,
    pub(super) spec: PolicySpec,
    pub(super) skill: Option<FrozenSkill>,
    pub(super) nets: PpoNets,
    pub(super) adam: Adam,
    pub(super) rewards: Option<RewardNormalizer>,
    pub(super) observations: Option<ObsNormalizer>,
    pub(super) streams: Streams,
    pub(super) updates: u64,
    pub(super) device: DeviceKind,
}

impl PpoLearner {
    /// Plain PPO with starting weights from `seed`.
    ///
    /// # Errors
    /// [`LearnError::Config`] for settings that cannot work.
    pub fn new(config: PpoConfig, spec: PolicySpec, seed: u64, device: DeviceKind) -> Result<Self, LearnError> {
        Self::build(config, spec, None, seed, device)
    }

    /// SCORE-PPO: tied to `model`'s decoder as `score` says.
    ///
    /// # Errors
    /// [`LearnError::Config`] for settings that cannot work.
    pub fn with_skill(
        config: PpoConfig,
        score: ScoreConfig,
        model: &SkillModel,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        let skill = FrozenSkill::new(score, model);
        Self::build(config, skill.spec(), Some(skill), seed, device)
    }

    pub(super) fn build(
        config: PpoConfig,
        spec: PolicySpec,
        skill: Option<FrozenSkill>,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        config.validate()?;
        spec.validate()?;
        if config.norm_obs && matches!(spec.obs, ObsKind::Image(_)) {
            let text = "ppo norm_obs is for vectors: the pixels of images are divided by 255 instead";
            return Err(LearnError::Config(text.to_owned()));
        }
        let streams = Streams::new(seed);
        let plain = device.plain();
        let copy = match &skill {
            Some(skill) => skill.copy(config.norm_obs)?,
            None => None,
        };
        let actor = match copy {
            Some(actor) => actor,
            None => fresh_actor(&config, &spec, &streams, &plain)?,
        };
        let shape = spec.net_shape(actor.obs_dim(spec.latent), &config.hidden, config.activation);
        let critic = Critic::new(&shape, &mut streams.stream("ppo.critic", 0), &plain);
        let adam = AdamConfig { eps: config.adam_eps, ..AdamConfig::default() };
        Ok(Self {
            nets: tracked(&PpoNets { actor, critic }),
            adam: Adam::new(adam),
            rewards: config.norm_reward.then(|| config.reward_normalizer()),
            observations: config.norm_obs.then(|| ObsNormalizer::new(spec.obs.numbers())),
            updates: 0,
            config,
            spec,
            skill,
            streams,
            device,
        })
    }

    /// The settings.
    pub fn config(&self) -> &PpoConfig {
        &self.config
    }

    /// Sets over how many updates a falling learning rate falls, for a training that shall go on for longer.
    pub fn set_total_updates(&mut self, total: Option<u64>) {
        self.config.total_updates = total;
    }

    /// The settings of SCORE, with a skill model.
    pub fn score_config(&self) -> Option<&ScoreConfig> {
        self.skill.as_ref().map(|skill| &skill.config)
    }

    /// What the policy reads and does. With a skill model rollouts need skills also where `latent` is 0
    /// ([`Self::rollout_latent`]).
    pub fn spec(&self) -> PolicySpec {
        self.spec
    }

    /// Width of the skills that a rollout must hold.
    pub fn rollout_latent(&self) -> usize {
        self.skill.as_ref().map_or(self.spec.latent, FrozenSkill::latent)
    }

    /// Updates done.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// The seed.
    pub fn seed(&self) -> u64 {
        self.streams.seed()
    }

    /// Where skills come from, by [`ScoreConfig::prior`]; `None` without a skill model.
    pub fn prior(&self) -> Option<Prior> {
        self.skill.as_ref().map(|skill| skill.prior(self.device))
    }

    /// Where the policy's skills come from, and its decoder; `None` without a skill model.
    pub fn skills(&self) -> Option<SkillSource> {
        self.skill.as_ref().map(|skill| skill.source(self.device))
    }

    /// A snapshot of the policy that plays, with its critic.
    pub fn policy(&self) -> Policy {
        let stats = present_stats(self.skill.as_ref(), self.observations.as_ref());
        let widths = (self.spec.obs, self.spec.latent);
        let (actor, critic) = (&self.nets.actor, Some(&self.nets.critic));
        Policy::new(actor, critic, stats, self.spec.action_space, widths, self.device.plain())
    }

    /// Mean divergence between decoder and policy over `n` rows, in nats: exactly 0 for a policy that is still a copy
    /// of the decoder. `None` without a skill model.
    ///
    /// # Errors
    /// [`LearnError::InitialKl`] if the policy should be a copy (no update was done, and
    /// [`ScoreConfig::init_from_decoder`]) and the divergence is not exactly 0; [`LearnError::Shape`].
    pub fn initial_kl<'a>(&self, z: &[f32], obs: impl Into<ObsSlice<'a>>, n: usize) -> Result<Option<f32>, LearnError> {
        let Some(skill) = &self.skill else { return Ok(None) };
        skill.initial_kl(&self.policy(), self.updates == 0, (z, obs.into(), n), self.device).map(Some)
    }

    /// Trains on a rollout: epochs × minibatches gradient steps.
    ///
    /// # Errors
    /// [`LearnError::Shape`], [`LearnError::Action`] or [`LearnError::Config`] if the rollout does not fit, and
    /// [`LearnError::Input`] if it holds numbers that are not finite, before anything is changed;
    /// [`LearnError::NotFinite`] and [`LearnError::Exploded`] name what ran away, and the learner is of no further use
    /// then.
    pub fn update(&mut self, rollout: &Rollout) -> Result<UpdateMetrics, LearnError> {
        rollout.check_for(&self.spec, self.rollout_latent())?;
        let rewards = match &mut self.rewards {
            Some(normalizer) => normalizer.normalize(&rollout.rewards, &rollout.done(), rollout.envs)?,
            None => rollout.rewards.clone(),
        };
        let config = &self.config;
        let estimate = gae(rollout, &rewards, config.gamma, config.lambda, config.time_limit);
        let explained = explained_variance(&rollout.values, &estimate.returns);
        let prepared = Prepared {
            rollout,
            advantages: estimate.advantages,
            returns: estimate.returns,
            decoder: self.decoder_rows(rollout)?,
            latent: self.spec.latent,
            stats: present_stats(self.skill.as_ref(), self.observations.as_ref()),
            norm_adv: config.norm_adv,
        };
        let lr = config.lr_at(self.updates);
        let mut rng = self.streams.stream("ppo.minibatches", self.updates);
        let mut rows: Vec<usize> = (0..rollout.rows()).collect();
        let (n, parts) = (rows.len(), config.minibatches.min(rows.len()));
        let mut sum = StepMetrics::default();
        for _ in 0..self.config.epochs {
            shuffle(&mut rows, &mut rng);
            for part in 0..parts {
                let rows = &rows[part * n / parts..(part + 1) * n / parts];
                sum.add(&self.step(&prepared, rows, lr)?);
            }
        }
        self.updates += 1;
        if let (Some(normalizer), Observations::Vector(values)) = (&mut self.observations, &rollout.obs) {
            normalizer.update(values);
        }
        let mean = |total: f64| (total / (self.config.epochs * parts) as f64) as f32;
        let penalised = prepared.decoder.is_some();
        Ok(UpdateMetrics {
            policy_loss: mean(sum.policy_loss),
            value_loss: mean(sum.value_loss),
            entropy: mean(sum.entropy),
            approx_kl: mean(sum.approx_kl),
            clip_fraction: mean(sum.clip_fraction),
            explained_variance: explained as f32,
            decoder_kl: penalised.then(|| mean(sum.decoder_kl)),
            alpha_mean: penalised.then(|| mean(sum.alpha_mean)),
            grad_norm: mean(sum.grad_norm),
            lr: lr as f32,
        })
    }

    pub(super) fn step(&mut self, prepared: &Prepared<'_>, rows: &[usize], lr: f64) -> Result<StepMetrics, LearnError> {
        let batch = prepared.minibatch(rows, &self.device.plain());
        let score = self.skill.as_ref().map(|skill| &skill.config);
        gradient_step(&mut self.nets, &mut self.adam, &batch, &self.config, score, lr)
    }

    /// The decoder's distributions and α for the whole rollout: it is frozen, so once per update is enough.
    fn decoder_rows(&self, rollout: &Rollout) -> Result<Option<DecoderRows>, LearnError> {
        let Some(skill) = &self.skill else { return Ok(None) };
        let mut rng = self.streams.stream("score.own_samples", self.updates);
        skill.rows((&rollout.z, &rollout.obs), &rollout.actions, false, &mut rng, self.device)
    }
}

/// An actor with weights of its own, and a trunk if it reads images.
fn fresh_actor(config: &PpoConfig, spec: &PolicySpec, streams: &Streams, device: &Device) -> Result<Actor, LearnError> {
    let features = match spec.obs {
        ObsKind::Vector(width) => width,
        ObsKind::Image(_) => config.cnn.features(),
    };
    let shape = spec.net_shape(features, &config.hidden, config.activation);
    let actor = Actor::new(&shape, spec.action_space, StdKind::Vector, &mut streams.stream("ppo.actor", 0), device);
    let ObsKind::Image(image) = spec.obs else { return Ok(actor) };
    Ok(actor.with_cnn(ImageNet::new(&config.cnn, image, &mut streams.stream("ppo.actor.cnn", 0), device)?))
}
