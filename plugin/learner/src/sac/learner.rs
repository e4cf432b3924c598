//! The learner: SAC, and SCORE-SAC if it is given a skill model.

use super::buffer::ReplayBuffer;
use super::explore::explorer;
use super::metrics::Sums;
use super::transitions::check_ends;
use super::{EntropyCoef, SacBatch, SacConfig, SacMetrics, SacNets, actor_step, alpha_step, critic_step, soft_update};
use crate::nn::{Adam, AdamConfig};
use crate::norm::{ObsNormalizer, RewardNormalizer};
use crate::policy::{Actor, Policy, SkillSource};
use crate::rng::{ChaCha8Rng, Streams};
use crate::score::{FrozenSkill, ScoreConfig, present_stats};
use crate::skill::{Prior, SkillModel};
use crate::{ActionSpace, DeviceKind, LearnError, ObsSlice, PolicySpec, Rollout};

/// Improves a policy from transitions, new and old.
///
/// Soft actor-critic (Haarnoja et al. 2018) with twin critics; with a skill model it is SCORE-SAC (see
/// [`crate::score`]). Continuous actions lie in [-1, 1]. The numbers depend only on the settings, the seed and the
/// rollouts.
#[derive(Debug)]
pub struct SacLearner {
    pub(super) config: SacConfig,
    pub(super) spec: PolicySpec,
    pub(super) skill: Option<FrozenSkill>,
    pub(super) nets: SacNets,
    pub(super) optimizers: Optimizers,
    pub(super) buffer: ReplayBuffer,
    pub(super) rewards: Option<RewardNormalizer>,
    pub(super) observations: Option<ObsNormalizer>,
    pub(super) streams: Streams,
    pub(super) updates: u64,
    pub(super) gradient_steps: u64,
    /// The part of a gradient step that is still owed.
    pub(super) carry: f64,
    pub(super) device: DeviceKind,
}

/// One Adam for each loss.
#[derive(Debug)]
pub(super) struct Optimizers {
    pub(super) critics: Adam,
    pub(super) actor: Adam,
    pub(super) alpha: Adam,
}

impl SacLearner {
    /// Plain SAC with starting weights from `seed`.
    ///
    /// # Errors
    /// [`LearnError::Config`] for settings that cannot work, or observations that are images.
    pub fn new(config: SacConfig, spec: PolicySpec, seed: u64, device: DeviceKind) -> Result<Self, LearnError> {
        Self::build(config, spec, None, seed, device)
    }

    /// SCORE-SAC: tied to `model`'s decoder as `score` says.
    ///
    /// Discrete actions: the actor can be an exact copy of the decoder, and the divergence is exact. Continuous
    /// actions: the actor squashes what the decoder does not, so it cannot be a copy
    /// ([`ScoreConfig::init_from_decoder`] must be false), and the two are compared before the tanh, the decoder as
    /// [`crate::score::unsquashed`] makes it.
    ///
    /// # Errors
    /// [`LearnError::Config`] for settings that cannot work, or a skill model of images.
    pub fn with_skill(
        config: SacConfig,
        score: ScoreConfig,
        model: &SkillModel,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        let skill = FrozenSkill::new(score, model);
        Self::build(config, skill.spec(), Some(skill), seed, device)
    }

    pub(super) fn build(
        config: SacConfig,
        spec: PolicySpec,
        skill: Option<FrozenSkill>,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        config.validate()?;
        spec.validate()?;
        let copy = match &skill {
            Some(skill) => skill.copy(config.norm_obs)?,
            None => None,
        };
        if copy.is_some() && matches!(spec.action_space, ActionSpace::Continuous(_)) {
            let text = "sac squashes continuous actions, so its policy cannot start as a copy of the decoder: set score \
                        init_from_decoder to false (the penalty still ties the two together)";
            return Err(LearnError::Config(text.to_owned()));
        }
        let streams = Streams::new(seed);
        let obs_dim = spec.obs.vector("SAC")?;
        let shape = spec.net_shape(obs_dim, &config.hidden, config.activation);
        let initial = match config.entropy {
            EntropyCoef::Auto { initial, .. } => initial,
            EntropyCoef::Fixed(_) => 1.0,
        };
        let nets = SacNets::new(&shape, spec.action_space, config.log_std, copy, initial, &streams, device);
        let adam = || Adam::new(AdamConfig { eps: config.adam_eps, ..AdamConfig::default() });
        let latent = skill.as_ref().map_or(spec.latent, FrozenSkill::latent);
        Ok(Self {
            nets,
            optimizers: Optimizers { critics: adam(), actor: adam(), alpha: adam() },
            buffer: ReplayBuffer::new(config.buffer, obs_dim, latent, &spec.action_space),
            rewards: config.norm_reward.then(|| RewardNormalizer::new(config.gamma)),
            observations: config.norm_obs.then(|| ObsNormalizer::new(obs_dim)),
            updates: 0,
            gradient_steps: 0,
            carry: 0.0,
            config,
            spec,
            skill,
            streams,
            device,
        })
    }

    /// The settings.
    pub fn config(&self) -> &SacConfig {
        &self.config
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
        self.buffer.latent
    }

    /// Calls of [`Self::update`] done.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// Gradient steps of the critics done.
    pub fn gradient_steps(&self) -> u64 {
        self.gradient_steps
    }

    /// Transitions taken in.
    pub fn transitions(&self) -> u64 {
        self.buffer.seen
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

    /// A snapshot of the policy that shall play now: the actor, or random actions as [`SacConfig::random_start`] says.
    /// It has no critic; its values are zeros.
    pub fn policy(&self) -> Policy {
        let copied = self.score_config().is_some_and(|score| score.init_from_decoder);
        let warming_up = self.buffer.seen < self.config.learning_starts;
        if warming_up && self.config.random_start && !copied {
            return self.snapshot(&explorer(self.spec.action_space, self.inputs(), &self.device.plain()));
        }
        self.snapshot(&self.nets.actor)
    }

    fn snapshot(&self, actor: &Actor) -> Policy {
        let stats = present_stats(self.skill.as_ref(), self.observations.as_ref());
        let widths = (self.spec.obs, self.spec.latent);
        Policy::new(actor, None, stats, self.spec.action_space, widths, self.device.plain())
    }

    /// Mean divergence between decoder and actor over `n` rows, in nats: exactly 0 for an actor that is still a copy of
    /// the decoder. `None` without a skill model.
    ///
    /// # Errors
    /// [`LearnError::InitialKl`] if the actor should be a copy (no gradient step was done, and
    /// [`ScoreConfig::init_from_decoder`]) and the divergence is not exactly 0; [`LearnError::Shape`].
    pub fn initial_kl<'a>(&self, z: &[f32], obs: impl Into<ObsSlice<'a>>, n: usize) -> Result<Option<f32>, LearnError> {
        let Some(skill) = &self.skill else { return Ok(None) };
        let actor = self.snapshot(&self.nets.actor);
        skill.initial_kl(&actor, self.gradient_steps == 0, (z, obs.into(), n), self.device).map(Some)
    }

    /// Takes in a rollout (with its [`Rollout::ends`]; log-probabilities and values are not read) and, once there are
    /// [`SacConfig::learning_starts`] transitions, does the gradient steps that are due.
    ///
    /// # Errors
    /// [`LearnError::Shape`], [`LearnError::Action`] or [`LearnError::Config`] if the rollout does not fit, and
    /// [`LearnError::Input`] if it holds numbers that are not finite, before anything is changed;
    /// [`LearnError::NotFinite`] and [`LearnError::Exploded`] name what ran away, and the learner is of no further use
    /// then.
    pub fn update(&mut self, rollout: &Rollout) -> Result<SacMetrics, LearnError> {
        rollout.check_for(&self.spec, self.rollout_latent())?;
        check_ends(rollout)?;
        if let Some(normalizer) = &mut self.rewards {
            normalizer.update(&rollout.rewards, &rollout.done(), rollout.envs)?;
        }
        if let Some(normalizer) = &mut self.observations {
            normalizer.update(rollout.obs.as_slice().vectors("SAC")?);
        }
        self.buffer.push(rollout)?;
        let mut sums = Sums::default();
        let due = self.steps_due(rollout.rows());
        for _ in 0..due {
            self.gradient_step(&mut sums)?;
        }
        self.updates += 1;
        let penalised = self.score_config().is_some_and(|score| score.kl);
        let entropy_coef = if due > 0 { Some(self.alpha()? as f32) } else { None };
        let (transitions, gradient_steps) = (self.buffer.seen, self.gradient_steps);
        Ok(SacMetrics { transitions, gradient_steps, entropy_coef, ..sums.means(penalised) })
    }

    /// Width of what the actor reads.
    pub(super) fn inputs(&self) -> usize {
        self.spec.latent + self.buffer.obs_dim
    }

    /// Whole gradient steps for `rows` new transitions.
    fn steps_due(&mut self, rows: usize) -> u64 {
        if self.buffer.seen < self.config.learning_starts {
            return 0;
        }
        let owed = self.carry + self.config.updates_per_step * rows as f64;
        self.carry = owed.fract();
        owed as u64
    }

    /// The critics' step, the actor's and α's where they are due, and the targets'.
    fn gradient_step(&mut self, sums: &mut Sums) -> Result<(), LearnError> {
        let number = self.gradient_steps;
        let slots = self.buffer.draw(self.config.batch, &mut self.streams.stream("sac.batch", number));
        let mut rng = self.streams.stream("sac.noise", number);
        self.gradient_steps += 1;
        let with_actor = self.gradient_steps.is_multiple_of(self.config.actor_every);
        let batch = self.batch(&slots, with_actor)?;
        let noise = self.noise(&mut rng);
        let (alpha, config) = (self.alpha()?, &self.config);
        let (nets, adams) = (&mut self.nets, &mut self.optimizers);
        let coefficients = (alpha, config.gamma);
        let step = critic_step(nets, &mut adams.critics, &batch, noise.as_ref(), coefficients, config.critic_lr)?;
        sums.add_critics(&step);
        if with_actor {
            for _ in 0..self.config.actor_every {
                self.actor_update(&batch, &mut rng, sums)?;
            }
        }
        if self.gradient_steps.is_multiple_of(self.config.target_every) {
            soft_update(&mut self.nets.targets, &self.nets.critics, self.config.tau);
        }
        Ok(())
    }

    /// A step of the actor and, if it is tuned, one of α.
    fn actor_update(&mut self, batch: &SacBatch, rng: &mut ChaCha8Rng, sums: &mut Sums) -> Result<(), LearnError> {
        let (alpha, noise) = (self.alpha()?, self.noise(rng));
        let score = self.skill.as_ref().map(|skill| &skill.config);
        let (nets, adams, config) = (&mut self.nets, &mut self.optimizers, &self.config);
        let step = actor_step(nets, &mut adams.actor, batch, noise.as_ref(), alpha, score, config.actor_lr)?;
        sums.add_actor(&step);
        if let Some(target) = self.config.target_entropy(self.spec.action_space) {
            let noise = self.noise(rng);
            let (nets, adam) = (&mut self.nets, &mut self.optimizers.alpha);
            sums.add_alpha(&alpha_step(nets, adam, batch, noise.as_ref(), target, self.config.alpha_lr)?);
        }
        Ok(())
    }

    /// What the transitions' entropy is worth now.
    fn alpha(&self) -> Result<f64, LearnError> {
        match self.config.entropy {
            EntropyCoef::Auto { .. } => self.nets.alpha(),
            EntropyCoef::Fixed(alpha) => Ok(alpha),
        }
    }
}
