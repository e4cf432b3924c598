//! The SAC learner, which is SCORE-SAC if it is given a skill model.

use super::buffer::{ReplayBuffer, Widths};
use super::demos::Demos;
use super::explore::explorer;
use super::nets::clock_width;
use super::{RlpdConfig, SacConfig, SacNets, check_ends};
use crate::file::{FileKind, TensorFile};
use crate::learner::{Checkpoint, Learner, LearnerBase, LearnerMetrics};
use crate::nn::{Adam, AdamConfig};
use crate::norm::RewardNormalizer;
use crate::policy::{Policy, StateBatch};
use crate::score::{ScoreConfig, Teacher, TiedTo};
use crate::skill::SkillModel;
use crate::{ActionSpace, DeviceKind, FileError, LearnError, ObsSlice, PolicySpec, Rollout};
use serde::{Deserialize, Serialize};
use std::path::Path;

const FILE: FileKind = FileKind { name: "sac checkpoint", version: 1 };

/// Improves a policy from transitions, new and old.
///
/// Soft actor-critic (Haarnoja et al. 2018) with twin critics; with a skill model it is SCORE-SAC (see
/// [`crate::score`]). Continuous actions lie in [-1, 1]. The numbers depend only on the settings, the seed and the
/// rollouts.
#[derive(Debug)]
pub struct SacLearner {
    pub(super) config: SacConfig,
    pub(crate) base: LearnerBase,
    pub(crate) nets: SacNets,
    pub(super) optimizers: Optimizers,
    pub(super) buffer: ReplayBuffer,
    /// Recordings that are learned from as well (RLPD).
    pub(super) demos: Option<Demos>,
    pub(super) gradient_steps: u64,
    /// The fraction of a gradient step that is carried over.
    pub(super) carry: f64,
}

/// One Adam for each loss.
#[derive(Debug)]
pub(super) struct Optimizers {
    pub(super) critics: Adam,
    pub(super) actor: Adam,
    pub(super) temperature: Adam,
}

impl Optimizers {
    fn new(config: &SacConfig) -> Self {
        let adam = || Adam::new(AdamConfig { eps: config.adam_eps, ..AdamConfig::default() });
        Self { critics: adam(), actor: adam(), temperature: adam() }
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
        let rewards = config.norm_reward.then(|| RewardNormalizer::new(config.gamma));
        let base = LearnerBase::new(spec, teacher, rewards, config.norm_obs, seed, device)?;
        let copies_decoder = base.copied_teacher().is_some_and(|teacher| teacher.tied_to.is_decoder());
        if copies_decoder && matches!(spec.action_space, ActionSpace::Continuous(_)) {
            let text = "sac squashes continuous actions, so its policy cannot start as a copy of the decoder: set score \
                        init_from_decoder to false (the penalty still ties the two together)";
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
        learner.buffer.take(&mut saved.file, "buffer", counters.transitions)?;
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
        self.base.initial_kl(&actor, self.gradient_steps == 0, StateBatch { z, left: &[], obs, n })
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
}
