//! Soft actor-critic (Haarnoja et al. 2018) for continuous and for discrete actions, with or without a skill decoder.
//!
//! Discrete actions take expectations over all choices instead of draws, and act by drawing from the policy; actor and
//! critics are networks of their own.
//!
//! The folder, in reading order:
//!
//! - `config`: settings of SAC and RLPD.
//! - `critics`: the networks: critics with the actor, the temperature, and slow copies as targets.
//! - `buffer`: the replay buffer; `batch`: batches of its transitions, prepared for a gradient step.
//! - `steps`: the gradient steps of critics, actor and temperature, with their losses.
//! - `metrics`: metrics of an update.

mod batch;
mod buffer;
mod config;
pub mod critics;
mod metrics;
mod steps;

use crate::{
    ActionSpace, DeviceKind, FileError, LearnError, ObsSlice, PolicySpec, Rollout,
    device::update_on,
    file::{FileKind, TensorFile},
    learner::{Checkpoint, Learner, LearnerBase, LearnerMetrics},
    nn::{Adam, AdamConfig, matrix},
    norm::RewardNormalizer,
    policy::{Policy, StateBatch},
    rng::{ChaCha8Rng, normal, shuffle},
    sac::{
        buffer::{Demos, ReplayBuffer, Widths, check_free},
        critics::clock_width,
        metrics::MetricSums,
        steps::explorer,
    },
    score::{ScoreConfig, Teacher, TiedTo},
    skill::SkillModel,
};
use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};
use std::{
    path::Path,
    time::{Duration, Instant},
};

pub(crate) use crate::sac::buffer::check_ends;
pub use crate::sac::{
    batch::SacBatch,
    config::{EntropyCoef, RlpdConfig, SacConfig},
    critics::{Critics, LogTemperature, QNet, SacNets, soft_update},
    metrics::SacMetrics,
    steps::{
        ActorStep, CriticStep, TemperatureStep, actor_step, critic_loss, critic_step, q_target, soft_value,
        soft_value_of_choices, target_of, temperature_loss, temperature_step,
    },
};

const FILE: FileKind = FileKind { name: "sac checkpoint", version: 1 };

/// Improves a policy from transitions, new and old.
///
/// Soft actor-critic (Haarnoja et al. 2018) with twin critics; with a skill model it is SCORE-SAC (see
/// [`crate::score`]). Continuous actions lie in [-1, 1]. The numbers depend only on the settings, the seed and the
/// rollouts.
#[derive(Debug)]
pub struct SacLearner {
    config: SacConfig,
    pub(crate) base: LearnerBase,
    pub(crate) nets: SacNets,
    optimizers: Optimizers,
    buffer: ReplayBuffer,
    /// Recordings that are learned from as well (RLPD).
    demos: Option<Demos>,
    gradient_steps: u64,
    /// The fraction of a gradient step that is carried over.
    carry: f64,
}

impl SacLearner {
    /// Creates plain SAC with starting weights from `seed`.
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings, or observations that are images.
    pub fn new(config: SacConfig, spec: PolicySpec, seed: u64, device: DeviceKind) -> Result<Self, LearnError> {
        Self::fresh(config, spec, None, seed, device)
    }

    /// Creates RLPD: SAC with recordings, each a rollout of one environment with its rewards and ends, in a share of
    /// each batch. Both normalisers begin with the recordings. Play may long earn nothing, and would give a recorded
    /// reward a huge scale.
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings, or recordings without any reward; else as [`Rollout::check`].
    pub fn with_demos(
        config: SacConfig,
        rlpd: &RlpdConfig,
        demos: &[Rollout],
        spec: PolicySpec,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        rlpd.validate()?;
        let mut learner = Self::fresh(rlpd.over(config), spec, None, seed, device)?;
        for episode in demos {
            episode.check_for(&spec, 0)?;
            check_free(episode, &spec.action_space)?;
            check_ends(episode)?;
            if let Some(normalizer) = &mut learner.base.observations {
                normalizer.update(episode.obs.as_slice().vectors("RLPD")?);
            }
            if let Some(normalizer) = &mut learner.base.rewards {
                normalizer.update_apart(&episode.rewards, &episode.done(), episode.envs)?;
            }
        }
        learner.demos = Some(Demos::new(demos, rlpd.demo_share, spec.obs.numbers(), &spec.action_space)?);
        Ok(learner)
    }

    /// Creates SCORE-SAC: tied to `model`'s decoder by the settings of `score`.
    ///
    /// For discrete actions the actor can be an exact copy of the decoder, and the divergence is exact. For
    /// continuous actions the actor squashes and the decoder does not, so it cannot be a copy
    /// ([`ScoreConfig::init_from_decoder`] must be false). The two are then compared before the tanh, with the
    /// decoder mapped by [`crate::nn::unsquashed`].
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings, or a skill model of images.
    pub fn with_skill(
        config: SacConfig,
        score: ScoreConfig,
        model: &SkillModel,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        let teacher = Teacher::new(score, TiedTo::Decoder, model, device)?;
        Self::fresh(config, teacher.policy_spec(), Some(teacher), seed, device)
    }

    /// Creates SAC with starting weights, tied to `teacher` if there is one.
    pub(crate) fn fresh(
        config: SacConfig,
        spec: PolicySpec,
        teacher: Option<Teacher>,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        let base = Self::new_base(&config, spec, teacher, seed, device)?;
        let nets = SacNets::fresh(&config, &base)?;
        Ok(Self::with_nets(config, base, nets))
    }

    fn new_base(
        config: &SacConfig,
        spec: PolicySpec,
        teacher: Option<Teacher>,
        seed: u64,
        device: DeviceKind,
    ) -> Result<LearnerBase, LearnError> {
        config.validate()?;
        config.check_space(spec.action_space)?;
        let rewards = config.norm_reward.then(|| RewardNormalizer::new(config.gamma));
        let base = LearnerBase::new(spec, teacher, rewards, config.norm_obs, seed, device)?;
        let copies_decoder = base.copied_teacher().is_some_and(|teacher| teacher.tied_to.is_decoder());
        if copies_decoder && matches!(spec.action_space, ActionSpace::Continuous(_)) {
            let text = "sac squashes continuous actions, so its policy cannot start as a copy of the decoder: set score \
                        init_from_decoder to false (the penalty still ties the two together)";
            return Err(LearnError::Config(text.to_owned()));
        }
        if base.teacher.as_ref().is_some_and(|teacher| !teacher.description.config.entities.blocks().is_empty()) {
            let text = "sac reads sets of things value by value, and cannot be tied to a skill model that reads them as \
                        sets: learn the skills with `skills.entities=Flat`";
            return Err(LearnError::Config(text.to_owned()));
        }
        spec.obs.vector("SAC")?;
        Ok(base)
    }

    fn with_nets(config: SacConfig, base: LearnerBase, nets: SacNets) -> Self {
        let widths = Widths {
            obs: base.spec.obs.numbers(),
            latent: base.rollout_latent(),
            clock: clock_width(&base),
            weight: usize::from(base.prior_origin().is_some()),
            legal: 0,
        };
        Self {
            nets,
            optimizers: Optimizers::new(&config),
            buffer: ReplayBuffer::new(config.buffer, widths, &base.spec.action_space),
            demos: None,
            gradient_steps: 0,
            carry: 0.0,
            config,
            base,
        }
    }

    /// Returns the settings.
    pub fn config(&self) -> &SacConfig {
        &self.config
    }

    /// Returns the number of gradient steps of the critics.
    pub fn gradient_steps(&self) -> u64 {
        self.gradient_steps
    }

    /// Returns the number of transitions added.
    pub fn transitions(&self) -> u64 {
        self.buffer.seen
    }

    /// Reads a file that [`Learner::save`] wrote. The learner continues exactly as the saved one would have.
    ///
    /// # Errors
    /// [`FileError`] describes the problem of the file, or names the tensor that is missing, superfluous or
    /// misshapen.
    pub fn load(path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        Self::stored(TensorFile::read(path)?, device)
    }

    /// Reads a file in memory as [`Self::load`] does.
    pub(crate) fn stored(file: TensorFile, device: DeviceKind) -> Result<Self, FileError> {
        let mut saved = Checkpoint::<SacConfig, Counters>::of(file, FILE, device)?;
        let base = Self::new_base(&saved.config, saved.spec, saved.teacher.take(), saved.seed, device);
        let base = base.map_err(|e| saved.file.learner(e))?;
        let nets = SacNets::stored(&saved.config, &base, &mut saved.file)?;
        let mut learner = Self::with_nets(saved.config.clone(), base, nets);
        let counters = &saved.counters;
        learner.optimizers.take(&mut saved.file, &mut learner.nets, counters)?;
        let space = learner.base.spec.action_space;
        learner.buffer.take(&mut saved.file, "buffer", counters.transitions, &space)?;
        learner.demos = match counters.demos {
            Some((rows, share)) => Some(Demos::stored(&mut saved.file, rows, share, &learner.base.spec)?),
            None => None,
        };
        learner.base.spec.action_space.check(&learner.buffer.actions).map_err(|e| saved.file.learner(e))?;
        (learner.gradient_steps, learner.carry) = (counters.gradient_steps, counters.carry);
        saved.finish(&mut learner.base)?;
        Ok(learner)
    }
}

impl Learner for SacLearner {
    fn base(&self) -> &LearnerBase {
        &self.base
    }

    /// Returns the actor, or random actions by [`SacConfig::random_start`]. It has no critic; its values are zeros.
    fn policy(&self) -> Policy {
        let copied = self.base.copied_teacher().is_some();
        let warming_up = self.buffer.seen < self.config.learning_starts;
        if warming_up && self.config.random_start && !copied {
            let device = self.base.device.plain();
            return self.base.snapshot(&explorer(self.base.spec.action_space, self.inputs(), &device), None);
        }
        self.base.snapshot(&self.nets.actor, None)
    }

    fn learn(&mut self, rollout: &Rollout) -> Result<LearnerMetrics, LearnError> {
        Ok(LearnerMetrics::new(self.update(rollout)?.scalars()))
    }

    /// Returns the divergence of the actor, also while random actions are played.
    fn initial_kl(&self, z: &[f32], obs: ObsSlice<'_>, n: usize) -> Result<Option<f32>, LearnError> {
        let actor = self.base.snapshot(&self.nets.actor, None);
        self.base.initial_kl(&actor, self.gradient_steps == 0, StateBatch { z, left: &[], memory: &[], obs, n })
    }

    /// Saves the learner. Weights are called `actor.l0.weight`, `q1.l0.weight`, `target.q1.l0.weight` and `log_alpha`
    /// (that of the temperature), moments `adam.m.actor.l0.weight`, the replay buffer `buffer.obs` and so on.
    fn save(&self, path: &Path) -> Result<(), FileError> {
        self.checkpoint(path)?.write()
    }
}

impl SacLearner {
    /// Returns the file that [`Learner::save`] writes.
    pub(crate) fn checkpoint(&self, path: &Path) -> Result<TensorFile, FileError> {
        let (nets, adams) = (&self.nets, &self.optimizers);
        let counters = Counters {
            gradient_steps: self.gradient_steps,
            carry: self.carry,
            transitions: self.buffer.seen,
            critic_steps: adams.critics.steps,
            actor_steps: adams.actor.steps,
            temperature_steps: adams.temperature.steps,
            demos: self.demos.as_ref().map(|demos| (demos.buffer.seen, demos.share)),
        };
        self.base.checkpoint(path, FILE, &self.config, &counters, |file| {
            file.put_network("actor", &nets.actor)?;
            file.put_network("", &nets.critics)?;
            file.put_network("target", &nets.targets)?;
            file.put_network("", &nets.log_temperature)?;
            for adam in [&adams.critics, &adams.actor, &adams.temperature] {
                file.put_adam(adam)?;
            }
            self.buffer.put(file, "buffer");
            if let Some(demos) = &self.demos {
                demos.buffer.put(file, "demos");
            }
            Ok(())
        })
    }

    /// Adds a rollout (with its [`Rollout::ends`]; log-probabilities and values are not read) and, once there are
    /// [`SacConfig::learning_starts`](SacConfig::learning_starts) transitions, does the gradient steps that are due.
    /// These take batches from the replay buffer, then steps of critics, actor and temperature, then targets. The
    /// losses and their steps are in `steps`.
    ///
    /// # Errors
    /// [`LearnError::Shape`], [`LearnError::Action`] or [`LearnError::Config`] if the rollout does not fit, and
    /// [`LearnError::Input`] if it holds numbers that are not finite, before anything is changed.
    /// [`LearnError::NotFinite`] and [`LearnError::Exploded`] name the number that diverged; the learner is unusable
    /// then.
    pub fn update(&mut self, rollout: &Rollout) -> Result<SacMetrics, LearnError> {
        update_on(&self.base.device.plain(), || {
            self.check_rollout(rollout)?;
            if let Some(normalizer) = &mut self.base.rewards {
                normalizer.update(&rollout.rewards, &rollout.done(), rollout.envs)?;
            }
            self.update_here(rollout, &[])
        })
    }

    /// Does [`Self::update`] for a policy over skills. The scale of its rewards is known already: they were added
    /// tick by tick. `weights` scales the next state's value of each row, beside the discount.
    pub(crate) fn update_of_skills(&mut self, rollout: &Rollout, weights: &[f32]) -> Result<SacMetrics, LearnError> {
        update_on(&self.base.device.plain(), || {
            self.check_rollout(rollout)?;
            self.update_here(rollout, weights)
        })
    }

    fn check_rollout(&self, rollout: &Rollout) -> Result<(), LearnError> {
        rollout.check_for(&self.base.spec, self.base.rollout_latent())?;
        check_free(rollout, &self.base.spec.action_space)?;
        check_ends(rollout)?;
        self.buffer.check_clock(rollout)
    }

    fn update_here(&mut self, rollout: &Rollout, weights: &[f32]) -> Result<SacMetrics, LearnError> {
        let base = &mut self.base;
        if let Some(normalizer) = &mut base.observations {
            normalizer.update(rollout.obs.as_slice().vectors("SAC")?);
        }
        self.buffer.push(rollout, weights)?;
        let mut sums = MetricSums::default();
        let due = self.steps_due(rollout.rows());
        let (start, before) = (Instant::now(), self.optimizers.spent());
        for _ in 0..due {
            self.gradient_step(&mut sums)?;
        }
        self.base.times.steps += start.elapsed();
        self.base.times.optimise += self.optimizers.spent() - before;
        self.base.updates += 1;
        let penalised = self.base.prior_origin().is_some() || self.base.score_config().is_some_and(|score| score.kl);
        let entropy_coef = if due > 0 { Some(self.temperature()? as f32) } else { None };
        let (transitions, gradient_steps) = (self.buffer.seen, self.gradient_steps);
        Ok(SacMetrics { transitions, gradient_steps, entropy_coef, ..sums.means(penalised) })
    }

    /// Returns the whole gradient steps for `rows` new transitions.
    fn steps_due(&mut self, rows: usize) -> u64 {
        if self.buffer.seen < self.config.learning_starts {
            return 0;
        }
        let owed = self.carry + self.config.updates_per_step * rows as f64;
        self.carry = owed.fract();
        owed as u64
    }

    /// Does the critics' step, the actor's and the temperature's where they are due, and the targets'.
    fn gradient_step(&mut self, sums: &mut MetricSums) -> Result<(), LearnError> {
        let number = self.gradient_steps;
        let drawn = self.draw(number)?;
        let seen_by_target = self.critics_of_target(number);
        let mut rng = self.base.streams.stream("sac.noise", number);
        self.gradient_steps += 1;
        let is_warming_up = number < self.config.critic_warmup;
        let with_actor = !is_warming_up && self.gradient_steps.is_multiple_of(self.config.actor_every);
        let start = Instant::now();
        let batch = self.batch(&drawn, seen_by_target, with_actor)?;
        self.base.times.gather += start.elapsed();
        let noise = self.noise(&mut rng);
        let (temperature, config) = (self.temperature()?, &self.config);
        let (nets, adam) = (&mut self.nets, &mut self.optimizers.critics);
        sums.add_critics(&critic_step(
            nets,
            adam,
            &batch,
            noise.as_ref(),
            temperature,
            config.gamma,
            config.critic_lr,
        )?);
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

    /// Returns the transitions of gradient step `number`: from play, and from recordings if there are any.
    fn draw(&self, number: u64) -> Result<ReplayBuffer, LearnError> {
        let recorded = self.demos.as_ref().map_or(0, |demos| demos.of_batch(&self.config));
        let mut rng = self.base.streams.stream("sac.batch", number);
        let played = self.buffer.draw(self.config.batch - recorded, &mut rng);
        match &self.demos {
            None => self.buffer.picked(&played, None),
            Some(demos) => {
                let slots = demos.buffer.draw(recorded, &mut rng);
                self.buffer.picked(&played, Some((&demos.buffer, &slots)))
            }
        }
    }

    /// Returns the critics whose least value is the target of gradient step `number`; empty for all.
    fn critics_of_target(&self, number: u64) -> Vec<usize> {
        let SacConfig { critics, target_critics, .. } = self.config;
        if target_critics >= critics {
            return Vec::new();
        }
        let mut all: Vec<usize> = (0..critics).collect();
        shuffle(&mut all, &mut self.base.streams.stream("sac.target_critics", number));
        all.truncate(target_critics);
        all
    }

    /// Does a step of the actor and, if it is tuned, one of the temperature.
    fn actor_update(
        &mut self,
        batch: &SacBatch,
        rng: &mut ChaCha8Rng,
        sums: &mut MetricSums,
    ) -> Result<(), LearnError> {
        let (temperature, noise) = (self.temperature()?, self.noise(rng));
        let (score, lr) = (self.base.score_config(), self.config.actor_lr);
        let (nets, adam) = (&mut self.nets, &mut self.optimizers.actor);
        sums.add_actor(&actor_step(nets, adam, batch, noise.as_ref(), temperature, score, lr)?);
        if let Some(target) = self.config.target_entropy(self.base.spec.action_space) {
            // A state with few legal actions has little entropy, whatever the temperature.
            let target = target * batch.entropy_share;
            let noise = self.noise(rng);
            let (nets, adam, lr) = (&mut self.nets, &mut self.optimizers.temperature, self.config.temperature_lr);
            sums.add_temperature(&temperature_step(nets, adam, batch, noise.as_ref(), target, lr)?);
        }
        Ok(())
    }

    /// Returns the present weight of entropy.
    pub(crate) fn temperature(&self) -> Result<f64, LearnError> {
        match self.config.entropy {
            EntropyCoef::Auto { .. } => self.nets.temperature(),
            EntropyCoef::Fixed(temperature) => Ok(temperature),
        }
    }

    /// Returns standard normal numbers for a batch of draws; discrete actions need none.
    fn noise(&self, rng: &mut ChaCha8Rng) -> Option<Tensor<2>> {
        let ActionSpace::Continuous(dim) = self.base.spec.action_space else { return None };
        let n = self.config.batch;
        Some(matrix((0..n * dim).map(|_| normal(rng)).collect(), n, dim, &self.base.device.plain()))
    }
}

/// One Adam for each loss.
#[derive(Debug)]
struct Optimizers {
    critics: Adam,
    actor: Adam,
    temperature: Adam,
}

impl Optimizers {
    fn new(config: &SacConfig) -> Self {
        let adam = || Adam::new(AdamConfig { eps: config.adam_eps, ..AdamConfig::default() });
        Self { critics: adam(), actor: adam(), temperature: adam() }
    }

    /// Returns the time spent on steps so far.
    fn spent(&self) -> Duration {
        [&self.critics, &self.actor, &self.temperature].iter().map(|adam| adam.spent()).sum()
    }

    /// Takes the moments out of a checkpoint.
    fn take(&mut self, file: &mut TensorFile, nets: &mut SacNets, counters: &Counters) -> Result<(), FileError> {
        file.take_adam(&mut self.critics, "", &mut nets.critics, counters.critic_steps)?;
        file.take_adam(&mut self.actor, "actor", &mut nets.actor, counters.actor_steps)?;
        file.take_adam(&mut self.temperature, "", &mut nets.log_temperature, counters.temperature_steps)
    }
}

/// The counters in a checkpoint.
#[derive(Serialize, Deserialize, Debug)]
struct Counters {
    gradient_steps: u64,
    carry: f64,
    transitions: u64,
    critic_steps: u64,
    actor_steps: u64,
    #[serde(rename = "alpha_steps")]
    temperature_steps: u64,
    /// Recorded transitions and their share of each batch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    demos: Option<(u64, f64)>,
}
