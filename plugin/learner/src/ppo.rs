//! Proximal policy optimisation (Schulman et al. 2017), with or without a skill decoder.
//!
//! The folder, in reading order:
//!
//! - `config`: settings of PPO.
//! - `batch`: the data of an update: a rollout with its advantages, and its minibatches in host memory.
//! - `sequences`: sequences of a rollout, for policies that remember.
//! - `objective`: the formulas of PPO: generalised advantage estimation on the host, and the losses as pure functions
//!   of tensors.
//! - `schedule`: the learning rate and the penalty's weight of each update.
//! - `step`: one gradient step: minibatch → loss → gradient → Adam.
//! - `curiosity`: an intrinsic reward, and all that it needs.
//! - `on_device`: an update on a graphics card: the rollout is sent once, and the numbers of all steps are read back
//!   together.
//! - `metrics`: metrics of a gradient step and of an update.
//! - `imitation`: the policy fitted to labelled observations.
//! - `take_over`: the start from another run's networks.

mod batch;
mod config;
mod curiosity;
mod imitation;
mod metrics;
mod objective;
mod on_device;
mod schedule;
mod sequences;
mod step;
mod take_over;

use crate::{
    DeviceKind, FileError, LearnError, ObsKind, ObsSlice, Observations, PolicySpec, Rollout, StartFrom, TakenOver,
    device::{guarded, update_on},
    file::{FileKind, TensorFile},
    learner::{Checkpoint, ContinuedSchedule, Learner, LearnerBase, LearnerMetrics},
    nn::{Adam, AdamConfig, Linear, ParamVisitor, Parameters, RandomInit, path, tracked},
    policy::{Actor, ActorShape, Critic, Memory, NetShape, Policy, StateBatch, StdShape},
    ppo::{
        batch::{Batch, JoinedRows, minibatches},
        curiosity::{INTRINSIC, Judged, Rnd, endless_critic, intrinsic_head},
        metrics::Has,
        on_device::{Reports, SentRollout, images_at_a_time},
        schedule::{Schedule, TakenUp},
        sequences::{minibatches_of, sequences},
        step::{UpdateSettings, step_in_parts},
    },
    rng::ChaCha8Rng,
    score::{ScoreConfig, Teacher, TeacherOutput, TiedTo},
    skill::SkillModel,
};
use playbot_kernels::host_numbers::is_host;
use serde::{Deserialize, Serialize};
use std::{cell::Cell, path::Path, time::Instant};

pub use crate::ppo::{
    config::{Curiosity, PpoConfig},
    curiosity::{Predictor, RndNet, combined_advantages, endless_gae, prediction_errors},
    imitation::{ImitationConfig, LabelledSteps},
    metrics::{RatioStats, StepMetrics, UpdateMetrics, explained_variance, ratio_stats},
    objective::{Advantages, PpoBatch, PpoLoss, gae, intrinsic_value_loss, normalize_advantages, ppo_loss},
    step::{Minibatch, gradient_step},
};

const FILE: FileKind = FileKind { name: "ppo checkpoint", version: 1 };

/// Improves a policy from rollouts.
///
/// Without a skill model this is PPO; with one it is SCORE-PPO (see [`crate::score`]). The numbers depend only on the
/// settings, the seed and the rollouts.
#[derive(Debug)]
pub struct PpoLearner {
    config: PpoConfig,
    pub(crate) base: LearnerBase,
    pub(crate) nets: PpoNets,
    adam: Adam,
    /// Rewards what is new; `None` without curiosity.
    curiosity: Option<Rnd>,
    taken_up: Option<TakenUp>,
    /// True if it began with the weights of another run, and so is no copy of the decoder.
    is_continuation: bool,
    /// Sizes of the last rollout's advantages.
    advantage_sizes: Vec<Option<f32>>,
}

impl PpoLearner {
    /// Creates plain PPO with starting weights from `seed`.
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings.
    pub fn new(config: PpoConfig, spec: PolicySpec, seed: u64, device: DeviceKind) -> Result<Self, LearnError> {
        Self::fresh(config, spec, None, seed, device)
    }

    /// Creates SCORE-PPO: tied to `model`'s decoder by the settings of `score`.
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings.
    pub fn with_skill(
        config: PpoConfig,
        score: ScoreConfig,
        model: &SkillModel,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        let teacher = Teacher::new(score, TiedTo::Decoder, model, device)?;
        Self::fresh(config, teacher.policy_spec(), Some(teacher), seed, device)
    }

    /// Creates PPO with starting weights, tied to `teacher` if there is one.
    pub(crate) fn fresh(
        config: PpoConfig,
        spec: PolicySpec,
        teacher: Option<Teacher>,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        let base = Self::new_base(&config, spec, teacher, seed, device)?;
        let nets = guarded(&base.device.plain(), || PpoNets::fresh(&config, &base))?;
        let curiosity = Rnd::fresh(&config, &base)?;
        Ok(Self::with_nets(config, base, &nets, curiosity))
    }

    fn new_base(
        config: &PpoConfig,
        spec: PolicySpec,
        teacher: Option<Teacher>,
        seed: u64,
        device: DeviceKind,
    ) -> Result<LearnerBase, LearnError> {
        config.validate()?;
        if config.norm_obs && matches!(spec.obs, ObsKind::Image(_)) {
            let text = "ppo norm_obs is for vectors: the pixels of images are divided by 255 instead";
            return Err(LearnError::Config(text.to_owned()));
        }
        config.check_observation(&spec.obs)?;
        let rewards = config.norm_reward.then(|| config.reward_normalizer());
        let mut base = LearnerBase::new(spec, teacher, rewards, config.norm_obs, seed, device)?;
        base.observations = base.observations.map(|normalizer| normalizer.tied(config.entities.blocks()));
        if let Some(teacher) = &base.teacher {
            config.check_sets(&teacher.description.config, teacher.is_copied())?;
        }
        Ok(base)
    }

    fn with_nets(config: PpoConfig, base: LearnerBase, nets: &PpoNets, curiosity: Option<Rnd>) -> Self {
        let PpoConfig { adam_eps: eps, weight_decay, .. } = config;
        let adam = Adam::new(AdamConfig { eps, weight_decay, ..AdamConfig::default() });
        let (taken_up, is_continuation, advantage_sizes) = (None, false, Vec::new());
        Self { config, base, nets: tracked(nets), adam, curiosity, taken_up, is_continuation, advantage_sizes }
    }

    /// Returns the settings.
    pub fn config(&self) -> &PpoConfig {
        &self.config
    }

    /// Returns the networks.
    pub fn nets(&self) -> &PpoNets {
        &self.nets
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
        let mut saved = Checkpoint::<PpoConfig, Counters>::of(file, FILE, device)?;
        let base = Self::new_base(&saved.config, saved.spec, saved.teacher.take(), saved.seed, device);
        let base = base.map_err(|e| saved.file.learner(e))?;
        let nets = PpoNets::stored(&saved.config, &base, &mut saved.file)?;
        let curiosity = Rnd::stored(&saved.config, &base, &mut saved.file, saved.counters.predictor_steps)?;
        let mut learner = Self::with_nets(saved.config.clone(), base, &nets, curiosity);
        saved.file.take_adam(&mut learner.adam, "", &mut learner.nets, saved.counters.adam_steps)?;
        (learner.taken_up, learner.is_continuation) = (saved.counters.taken_up, saved.counters.is_continuation);
        saved.finish(&mut learner.base)?;
        Ok(learner)
    }

    /// Returns the file that [`Learner::save`] writes.
    pub(crate) fn checkpoint(&self, path: &Path) -> Result<TensorFile, FileError> {
        let Self { taken_up, is_continuation, .. } = *self;
        let predictor_steps = self.curiosity.as_ref().map_or(0, Rnd::steps);
        let counters = Counters { adam_steps: self.adam.steps, predictor_steps, taken_up, is_continuation };
        self.base.checkpoint(path, FILE, &self.config, &counters, |file| {
            file.put_network("", &self.nets)?;
            file.put_adam(&self.adam)?;
            self.curiosity.as_ref().map_or(Ok(()), |curiosity| curiosity.put(file))
        })
    }
}

impl Learner for PpoLearner {
    fn base(&self) -> &LearnerBase {
        &self.base
    }

    /// Returns the policy that plays, with its critic.
    fn policy(&self) -> Policy {
        self.base.snapshot(&self.nets.actor, Some(&self.nets.critic))
    }

    fn learn(&mut self, rollout: &Rollout) -> Result<LearnerMetrics, LearnError> {
        Ok(LearnerMetrics::new(self.update(rollout)?.scalars()))
    }

    fn initial_kl(&self, z: &[f32], obs: ObsSlice<'_>, n: usize) -> Result<Option<f32>, LearnError> {
        let is_copy = self.base.updates == 0 && !self.is_continuation;
        self.base.initial_kl(&self.policy(), is_copy, StateBatch { z, left: &[], memory: &[], obs, n })
    }

    fn advantage_sizes(&self) -> &[Option<f32>] {
        &self.advantage_sizes
    }

    /// Saves the learner. Weights are called `actor.l0.weight` (`[inputs, outputs]`), moments
    /// `adam.m.actor.l0.weight`.
    fn save(&self, path: &Path) -> Result<(), FileError> {
        self.checkpoint(path)?.write()
    }

    fn start_from(&mut self, start: &StartFrom<'_>) -> Result<TakenOver, FileError> {
        let other = Self::load(start.path, self.base.device)?;
        self.take_over(other, start).map_err(|source| FileError::Learner { path: start.path.to_owned(), source })
    }

    fn set_total_updates(&mut self, total: Option<u64>) -> Option<ContinuedSchedule> {
        if total == self.config.total_updates {
            return None;
        }
        let taken_up = self.schedule().take_up(self.base.updates);
        self.config.total_updates = total;
        let (taken_up, continued) = taken_up?;
        self.taken_up = Some(taken_up);
        Some(continued)
    }
}

impl PpoLearner {
    /// Trains on a rollout: epochs × minibatches gradient steps, from the rollout to advantages, minibatches, loss and
    /// step. The formulas are in `objective`.
    ///
    /// # Errors
    /// [`LearnError::Shape`], [`LearnError::Action`] or [`LearnError::Config`] if the rollout does not fit, and
    /// [`LearnError::Input`] if it holds numbers that are not finite, before anything is changed.
    /// [`LearnError::NotFinite`] and [`LearnError::Exploded`] name the number that diverged; the learner is unusable
    /// then, as after [`LearnError::DeviceFailed`].
    pub fn update(&mut self, rollout: &Rollout) -> Result<UpdateMetrics, LearnError> {
        self.update_of_skills(rollout, &[])
    }

    /// Does [`Self::update`] with a rollout of skills, in which the rows of each environment follow one another. `chains`
    /// holds the end of each such chain, exclusive; it is empty for a rollout of ticks.
    ///
    /// # Errors
    /// As [`Self::update`].
    pub(crate) fn update_of_skills(
        &mut self,
        rollout: &Rollout,
        chains: &[usize],
    ) -> Result<UpdateMetrics, LearnError> {
        update_on(&self.base.device.plain(), || self.update_here(rollout, chains))
    }

    fn update_here(&mut self, rollout: &Rollout, chains: &[usize]) -> Result<UpdateMetrics, LearnError> {
        rollout.check_for(&self.base.spec, self.base.rollout_latent())?;
        let remembered = rollout.rows() * self.nets.actor.memory.as_ref().map_or(0, Memory::width);
        LearnError::check("memory of the rollout", remembered, rollout.memory.len())?;
        let rewards = match &mut self.base.rewards {
            Some(normalizer) => normalizer.normalize(&rollout.rewards, &rollout.done(), rollout.envs)?,
            None => rollout.rewards.clone(),
        };
        let config = &self.config;
        let mut estimate = gae(rollout, &rewards, config.gamma, config.lambda, config.time_limit);
        let explained_variance = explained_variance(&rollout.values, &estimate.returns);
        self.advantage_sizes.clear();
        self.advantage_sizes.extend(estimate.advantages.iter().map(|advantage| Some(advantage.abs())));
        let latent = self.base.spec.latent;
        let teacher = self.teacher_output(rollout)?;
        let start = Instant::now();
        let (mut intrinsic_returns, mut curious) = (Vec::new(), None);
        if let (Some(curiosity), Some(head)) = (&mut self.curiosity, &self.nets.intrinsic) {
            let critic = self.base.snapshot(&self.nets.actor, Some(&endless_critic(&self.nets.critic, head)));
            let judged = curiosity.update((rollout, chains), &estimate.advantages, &critic, config, &self.base)?;
            let Judged { advantages, returns, reward, predictor_loss } = judged;
            (estimate.advantages, intrinsic_returns, curious) = (advantages, returns, Some((reward, predictor_loss)));
        }
        let joined = JoinedRows::of(rollout, latent, self.base.obs_stats().as_deref());
        let batch = Batch {
            rollout,
            space: self.base.spec.action_space,
            advantages: estimate.advantages,
            returns: estimate.returns,
            intrinsic_returns,
            teacher,
            latent,
            joined,
            norm_adv: config.norm_adv,
            augment: (config.augment.clone(), self.base.streams.stream("ppo.augment", self.base.updates).into()),
            gathering: Cell::new(start.elapsed()),
        };
        let (lr, score) = (self.schedule().lr(self.base.updates), self.schedule().score(self.base.updates));
        let is_warming_up = self.base.updates < config.critic_warmup;
        self.prepare_adam(is_warming_up);
        let moment = UpdateSettings { lr, score: score.as_ref(), is_warming_up };
        let mut rng = self.base.streams.stream("ppo.minibatches", self.base.updates);
        let before = self.adam.spent();
        let (sum, steps) = match self.config.memory.sequences() {
            Some(sequences) => self.steps_over_sequences(&batch, sequences, &mut rng, &moment)?,
            None => {
                let sum = match is_host(&self.base.device.plain()) {
                    true => self.steps(&batch, &mut rng, &moment)?,
                    false => self.steps_on_device(&batch, &mut rng, &moment)?,
                };
                (sum, self.config.epochs * self.config.minibatches.min(rollout.rows()))
            }
        };
        self.base.updates += 1;
        let times = &mut self.base.times;
        times.steps += start.elapsed();
        times.gather += batch.gathering.get();
        times.optimise += self.adam.spent() - before;
        if let (Some(normalizer), Observations::Vector(values)) = (&mut self.base.observations, &rollout.obs) {
            normalizer.update(values);
        }
        let has =
            Has { penalty: batch.teacher.is_some(), augmentation: !self.config.augment.is_empty(), curiosity: curious };
        Ok(UpdateMetrics::mean(&sum, steps, has, explained_variance, lr))
    }

    fn schedule(&self) -> Schedule<'_> {
        Schedule { config: &self.config, score: self.base.score_config(), taken_up: self.taken_up }
    }

    /// Restarts Adam when the policy begins to learn. While the critic warms up the policy's gradients are zero. The
    /// moments stay 0 while their bias correction wears off, so its first steps would be several times too long. Before
    /// that there is no weight decay, either.
    fn prepare_adam(&mut self, is_warming_up: bool) {
        let PpoConfig { critic_warmup, weight_decay, .. } = self.config;
        let config = AdamConfig { weight_decay: if is_warming_up { 0.0 } else { weight_decay }, ..self.adam.config };
        if critic_warmup > 0 && self.base.updates == critic_warmup {
            self.adam = Adam::new(config);
        }
        self.adam.config = config;
    }

    fn steps(
        &mut self,
        batch: &Batch<'_>,
        rng: &mut ChaCha8Rng,
        moment: &UpdateSettings<'_>,
    ) -> Result<StepMetrics, LearnError> {
        let device = self.base.device.plain();
        let mut sum = StepMetrics::default();
        for rows in minibatches(&self.config, batch.rollout.rows(), rng) {
            let parts = batch.parts(&rows, self.nets.actor.cnn.as_ref(), moment, &device);
            let step = step_in_parts(&mut self.nets, &mut self.adam, parts, &self.config, moment)?;
            sum.add(&step, 1.0);
        }
        Ok(sum)
    }

    /// Does the gradient steps of a policy that remembers. Returns the sum of their metrics, and their number.
    fn steps_over_sequences(
        &mut self,
        batch: &Batch<'_>,
        (length, burn_in): (usize, usize),
        rng: &mut ChaCha8Rng,
        moment: &UpdateSettings<'_>,
    ) -> Result<(StepMetrics, usize), LearnError> {
        let device = self.base.device.plain();
        let all = sequences(batch.rollout, length, burn_in);
        let (epochs, count) = (self.config.epochs, self.config.minibatches.min(all.len()));
        let mut sum = StepMetrics::default();
        for sequences in minibatches_of(all, epochs, count, rng) {
            let parts = batch.parts_of_sequences(&sequences, self.nets.actor.cnn.as_ref(), moment, &device);
            let step = step_in_parts(&mut self.nets, &mut self.adam, parts, &self.config, moment)?;
            sum.add(&step, 1.0);
        }
        Ok((sum, epochs * count))
    }

    fn steps_on_device(
        &mut self,
        batch: &Batch<'_>,
        rng: &mut ChaCha8Rng,
        moment: &UpdateSettings<'_>,
    ) -> Result<StepMetrics, LearnError> {
        let start = Instant::now();
        let minibatches = minibatches(&self.config, batch.rollout.rows(), rng);
        let sent = SentRollout::send(batch, minibatches, &self.base.device.plain());
        batch.gathered(start);
        let (mut reports, before) = (Reports::default(), self.adam.steps());
        let at_a_time = images_at_a_time(batch, &self.nets, moment);
        for parts in sent.minibatches(at_a_time) {
            reports.step(&mut self.nets, &mut self.adam, parts, &self.config, moment)?;
        }
        reports.sum(before)
    }

    /// Returns the decoder's outputs for the whole rollout: it is frozen, so once per update is enough.
    fn teacher_output(&self, rollout: &Rollout) -> Result<Option<TeacherOutput>, LearnError> {
        let Some(teacher) = &self.base.teacher else { return Ok(None) };
        let mut rng = self.base.streams.stream("score.own_samples", self.base.updates);
        let states =
            StateBatch { z: &rollout.z, left: &[], memory: &[], obs: rollout.obs.as_slice(), n: rollout.rows() };
        teacher.output(states, (&rollout.actions, &rollout.legal), false, &mut rng, self.base.device)
    }
}

/// The counters in a checkpoint.
#[derive(Serialize, Deserialize, Debug)]
struct Counters {
    adam_steps: u64,
    /// Gradient steps of the predictor, only in runs with curiosity.
    #[serde(default, skip_serializing_if = "crate::settings::is_off")]
    predictor_steps: u64,
    /// Only in runs that got another length.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    taken_up: Option<TakenUp>,
    /// Only in runs that began with the weights of another.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    is_continuation: bool,
}

// Actor and critic as one set of parameters.

/// The networks of PPO: the parameters `actor.*`, `critic.*` and `intrinsic.*`, whose gradients are clipped together. The trunk of
/// images, `actor.cnn.*`, is the critic's too.
#[derive(Clone, Debug)]
pub struct PpoNets {
    /// The policy.
    pub actor: Actor,
    /// The value function.
    pub critic: Critic,
    /// The critic's second head, for intrinsic rewards; `None` without curiosity.
    pub intrinsic: Option<Linear>,
}

impl PpoNets {
    /// Creates a copy of the decoder, or starting weights from the stream `ppo.actor`, and a critic with some from
    /// `ppo.critic`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if images are too small for the convolutions.
    fn fresh(config: &PpoConfig, base: &LearnerBase) -> Result<Self, LearnError> {
        let (shape, device) = (actor_shape(config, base), base.device.plain());
        let actor = match base.copied_teacher() {
            Some(teacher) => {
                let origin = teacher.origin().clone();
                let mut rng = base.streams.stream("ppo.memory", 0);
                let source = RandomInit { rng: &mut rng, device: &device };
                match config.memory.shape() {
                    Some(memory) => origin.with_new_memory(base.spec.latent, memory, source),
                    None => origin,
                }
            }
            None => shape.fresh(&base.spec, &base.streams, "ppo.actor", &device)?,
        };
        let mut rng = base.streams.stream("ppo.critic", 0);
        let critic = Critic::new(&critic_shape(config, &shape), &mut rng, &device);
        let counts = base.score_config().is_some_and(|score| score.critic_clock);
        let Ok(critic) =
            if counts { critic.with_clock(&mut RandomInit { rng: &mut rng, device: &device }, "") } else { Ok(critic) };
        let mut rng = base.streams.stream("ppo.intrinsic", 0);
        let Ok(intrinsic) = intrinsic_head(config, &critic, &mut RandomInit { rng: &mut rng, device: &device });
        Ok(Self { actor, critic, intrinsic })
    }

    /// Reads the networks of a checkpoint.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen.
    fn stored(config: &PpoConfig, base: &LearnerBase, file: &mut TensorFile) -> Result<Self, FileError> {
        let (shape, device) = (actor_shape(config, base), base.device.plain());
        let actor = shape.stored(&base.spec, file, "actor", &device)?;
        let critic = critic_shape(config, &shape).stored_critic(file, "critic", &device)?;
        let intrinsic = intrinsic_head(config, &critic, &mut file.params(&device))?;
        Ok(Self { actor, critic, intrinsic })
    }
}

/// Returns the layers of the network that it copies, if it is a copy, else those of the settings.
fn actor_shape(config: &PpoConfig, base: &LearnerBase) -> ActorShape {
    let shape = match base.copied_teacher() {
        Some(teacher) => teacher.shape(),
        None => ActorShape::new(&base.spec, &config.cnn, &config.hidden, config.activation, StdShape::Vector)
            .with_entities(&config.entities),
    };
    shape.with_memory(config.memory.shape())
}

/// Returns the shape of the critic, which reads the same inputs as the actor's layers, through layers of its own.
fn critic_shape(config: &PpoConfig, actor: &ActorShape) -> NetShape {
    NetShape { hidden: config.hidden.clone(), activation: config.activation, ..actor.net }
}

impl Parameters for PpoNets {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.actor.visit(&path(prefix, "actor"), visitor);
        self.critic.visit(&path(prefix, "critic"), visitor);
        if let Some(intrinsic) = &mut self.intrinsic {
            intrinsic.visit(&path(prefix, INTRINSIC), visitor);
        }
    }
}
