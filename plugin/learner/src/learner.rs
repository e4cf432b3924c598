//! The common interface and frame of all learners.

use crate::{
    DeviceKind, FileError, InputMap, LearnError, ObsSlice, PolicySpec, Rollout, StartFrom, TakenOver,
    device::guarded,
    file::{FileKind, TensorFile},
    norm::{ObsNormalizer, ObsStats, RewardNormalizer, put_normalizers, take_normalizers},
    policy::{Actor, Critic, Policy, StateBatch},
    rng::Streams,
    score::{ScoreConfig, Teacher, TiedTo},
    skill::{Prior, SkillDescription, SkillModel, SkillSource},
};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::{fmt::Debug, path::Path, sync::Arc, time::Duration};

/// Improves a policy from rollouts.
///
/// ```
/// use playbot_learner::{ActionSpace, DeviceKind, Learner, PolicySpec, PpoConfig, PpoLearner, SacConfig, SacLearner};
///
/// let spec = PolicySpec { obs: 2.into(), latent: 0, action_space: ActionSpace::Discrete(3) };
/// let learners: [Box<dyn Learner>; 2] = [
///     Box::new(PpoLearner::new(PpoConfig::default(), spec, 1, DeviceKind::Flex)?),
///     Box::new(SacLearner::new(SacConfig::default(), spec, 1, DeviceKind::Flex)?),
/// ];
/// for learner in &learners {
///     assert_eq!((learner.spec(), learner.rollout_latent(), learner.updates()), (spec, 0, 0));
///     assert!(learner.skills().is_none() && learner.policy().forward(&[], &[0.5, -0.5], 1).is_ok());
/// }
/// # Ok::<(), playbot_learner::LearnError>(())
/// ```
pub trait Learner: Debug + Send {
    /// Returns the common part of all learners.
    fn base(&self) -> &LearnerBase;

    /// Returns a snapshot of the policy that plays next.
    fn policy(&self) -> Policy;

    /// Learns from a rollout.
    ///
    /// # Errors
    /// [`LearnError`] if it does not fit, or names the number that diverged.
    fn learn(&mut self, rollout: &Rollout) -> Result<LearnerMetrics, LearnError>;

    /// Returns the mean divergence between decoder and policy over `n` rows, in nats. It is exactly 0 for a policy that
    /// is still a copy of the decoder. `None` without a skill model.
    ///
    /// # Errors
    /// [`LearnError::InitialKl`] if the policy should be a copy ([`ScoreConfig::init_from_decoder`], and it was not
    /// trained yet) and the divergence is not exactly 0; [`LearnError::Shape`].
    fn initial_kl(&self, z: &[f32], obs: ObsSlice<'_>, n: usize) -> Result<Option<f32>, LearnError>;

    /// Returns the sizes of the advantages of the last rollout, |A| for each of its rows, before they were normalised:
    /// how much the critic could still learn there (Jiang et al. 2021, "Prioritized Level Replay", "L1 value loss").
    /// `None` in a row in which nothing was decided. Empty before the first rollout, and for a learner that estimates no
    /// advantages.
    fn advantage_sizes(&self) -> &[Option<f32>] {
        &[]
    }

    /// Writes the complete state, so that training continues bit for bit. The file gets a temporary name first, so a
    /// checkpoint is complete or absent.
    ///
    /// # Errors
    /// [`FileError::Io`] if it cannot be written.
    fn save(&self, path: &Path) -> Result<(), FileError>;

    /// Sets the number of updates of the whole run, for a run that is prolonged. A learning rate and a weight of the
    /// penalty that change over the run go on from their last values, which are returned. Has no effect on learners
    /// whose values do not change.
    fn set_total_updates(&mut self, _: Option<u64>) -> Option<ContinuedSchedule> {
        None
    }

    /// Takes over the layers that fit and the normalisers from the checkpoint of another run, before the first update.
    /// Counters stay those of a new learner, and so does the optimiser, unless its moments are asked for.
    ///
    /// # Errors
    /// [`FileError`] if the file cannot be read, no layer of its policy fits, or the algorithm cannot start from another
    /// run.
    fn start_from(&mut self, start: &StartFrom<'_>) -> Result<TakenOver, FileError> {
        let text = "only ppo, score-ppo and spirl-ppo can start from the weights of another run".to_owned();
        Err(FileError::Learner { path: start.path.to_owned(), source: LearnError::Config(text) })
    }

    /// Returns its skill model for the start of another learner, or for one with a longer observation by `inputs`; `None`
    /// without skills. A learner keeps no encoder, so the model can be used and not saved.
    ///
    /// # Errors
    /// [`LearnError::Config`] if `inputs` are those of another observation.
    fn skill_model(&self, inputs: Option<&InputMap>) -> Result<Option<SkillModel>, LearnError> {
        let base = self.base();
        let Some(teacher) = &base.teacher else { return Ok(None) };
        let (actors, description) = (&teacher.actors, &teacher.description);
        SkillModel::of_actors(actors, description, teacher.stats.as_deref(), inputs, base.device).map(Some)
    }

    /// Returns the inputs and outputs of the policy. With a skill model rollouts need skills even if `latent` is 0
    /// ([`Self::rollout_latent`]).
    fn spec(&self) -> PolicySpec {
        self.base().spec
    }

    /// Returns the width of the skills that a rollout must hold.
    fn rollout_latent(&self) -> usize {
        self.base().rollout_latent()
    }

    /// Returns the number of rollouts learned from.
    fn updates(&self) -> u64 {
        self.base().updates
    }

    /// Returns the seed.
    fn seed(&self) -> u64 {
        self.base().streams.seed()
    }

    /// Returns the time spent on gradient steps since this learner was made. It is not saved.
    fn times(&self) -> LearnTimes {
        self.base().times
    }

    /// Returns the settings of SCORE, with a skill model.
    fn score_config(&self) -> Option<&ScoreConfig> {
        self.base().score_config()
    }

    /// Returns the source of skills, by [`ScoreConfig::prior`]; `None` without a skill model.
    fn prior(&self) -> Option<Prior> {
        let base = self.base();
        base.teacher.as_ref().map(|teacher| teacher.prior(base.device))
    }

    /// Returns the source of the policy's skills, and its decoder; `None` without a skill model.
    fn skills(&self) -> Option<SkillSource> {
        let base = self.base();
        base.teacher.as_ref().map(|teacher| teacher.source(base.device))
    }
}

/// Time that a learner has spent on gradient steps, by the clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LearnTimes {
    /// All of it.
    pub steps: Duration,
    /// Assembling minibatches, out of rollouts or a replay buffer.
    pub gather: Duration,
    /// Steps of the optimiser. A graphics card may go on with one while the next minibatch is prepared.
    pub optimise: Duration,
}

impl LearnTimes {
    /// Returns the time of the products and sums in networks and losses, forward and backward.
    pub fn products(&self) -> Duration {
        self.steps.saturating_sub(self.gather).saturating_sub(self.optimise)
    }

    /// Combines two times.
    pub(crate) fn zip(self, other: Self, combine: fn(Duration, Duration) -> Duration) -> Self {
        Self {
            steps: combine(self.steps, other.steps),
            gather: combine(self.gather, other.gather),
            optimise: combine(self.optimise, other.optimise),
        }
    }

    /// Returns the time since `before`, an earlier value.
    pub fn since(self, before: Self) -> Self {
        self.zip(before, Duration::saturating_sub)
    }
}

/// The values from which a prolonged run goes on to those of its end. Values that do not change are `None`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContinuedSchedule {
    /// The learning rate of the last update. It falls to 0.
    pub lr: Option<f64>,
    /// The weight of the decoder's penalty in the last update, and that at the end of the run.
    pub kl_coef: Option<(f64, f64)>,
}

/// The metrics of an update of any learner: numbers by their TensorBoard tags.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnerMetrics {
    scalars: Vec<(&'static str, f64)>,
}

impl LearnerMetrics {
    pub(crate) fn new(scalars: Vec<(&'static str, f64)>) -> Self {
        Self { scalars }
    }

    /// Returns the numbers by their tags; unmeasured ones are left out.
    pub fn scalars(&self) -> impl Iterator<Item = (&'static str, f64)> {
        self.scalars.iter().copied()
    }
}

/// The common part of all learners: the policy's inputs and outputs, the skill model that it is tied to, normalisers,
/// random numbers, and the device.
#[derive(Debug)]
pub struct LearnerBase {
    pub(crate) spec: PolicySpec,
    /// The frozen skill model; `None` without SCORE.
    pub(crate) teacher: Option<Teacher>,
    pub(crate) rewards: Option<RewardNormalizer>,
    pub(crate) observations: Option<ObsNormalizer>,
    pub(crate) streams: Streams,
    /// Number of rollouts learned from.
    pub(crate) updates: u64,
    pub(crate) device: DeviceKind,
    /// Time spent on gradient steps since this learner was made.
    pub(crate) times: LearnTimes,
}

impl LearnerBase {
    /// Creates a learner's base before its first update; `norm_obs`: the learner normalises observations itself.
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings.
    pub(crate) fn new(
        spec: PolicySpec,
        teacher: Option<Teacher>,
        rewards: Option<RewardNormalizer>,
        norm_obs: bool,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        device.check()?;
        spec.validate()?;
        if let Some(teacher) = &teacher {
            teacher.check(norm_obs)?;
        }
        let observations = norm_obs.then(|| ObsNormalizer::new(spec.obs.numbers()));
        Ok(Self {
            spec,
            teacher,
            rewards,
            observations,
            streams: Streams::new(seed),
            updates: 0,
            device,
            times: LearnTimes::default(),
        })
    }

    /// Returns the settings of SCORE, with a skill model.
    pub(crate) fn score_config(&self) -> Option<&ScoreConfig> {
        self.teacher.as_ref().map(|teacher| &teacher.config)
    }

    /// Returns the skill model, if the policy starts as a copy of its decoder.
    pub(crate) fn copied_teacher(&self) -> Option<&Teacher> {
        self.teacher.as_ref().filter(|teacher| teacher.is_copied())
    }

    /// Returns the prior, for a policy over skills that starts as it.
    pub(crate) fn prior_origin(&self) -> Option<&Actor> {
        self.teacher.as_ref().filter(|teacher| !teacher.tied_to.is_decoder()).map(Teacher::origin)
    }

    /// Returns the width of the skills that a rollout must hold.
    pub(crate) fn rollout_latent(&self) -> usize {
        self.teacher.as_ref().map_or(self.spec.latent, Teacher::rollout_latent)
    }

    /// Returns the present normalisation of the networks' observations. It is the frozen normaliser of the skill model
    /// if that has one, else the learner's own running one, else `None`.
    pub(crate) fn obs_stats(&self) -> Option<Arc<ObsStats>> {
        let frozen = self.teacher.as_ref().and_then(|teacher| teacher.stats.clone());
        frozen.or_else(|| self.observations.as_ref().map(|normalizer| Arc::new(normalizer.snapshot())))
    }

    /// Returns a snapshot of networks with the present normalisation of observations.
    pub(crate) fn snapshot(&self, actor: &Actor, critic: Option<&Critic>) -> Policy {
        Policy::new(actor, critic, self.obs_stats(), self.spec, self.device.plain())
    }

    /// Returns the mean divergence between decoder and `policy`, as
    /// [`Learner::initial_kl`] does.
    pub(crate) fn initial_kl(
        &self,
        policy: &Policy,
        untrained: bool,
        states: StateBatch<'_>,
    ) -> Result<Option<f32>, LearnError> {
        let Some(teacher) = &self.teacher else { return Ok(None) };
        teacher.initial_kl(policy, untrained, states, self.device).map(Some)
    }
}

// A learner's complete state in one file: the frame that all learners share.

/// The JSON in the header of every learner's checkpoint: the settings `C`, the common state, and the counters `K` of
/// the algorithm.
///
/// A learner's generators are streams of `seed` numbered by its counters, so these are their whole state.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header<C, K> {
    config: C,
    spec: PolicySpec,
    score: Option<ScoreConfig>,
    skill: Option<SkillDescription>,
    #[serde(default, skip_serializing_if = "TiedTo::is_decoder")]
    tied_to: TiedTo,
    seed: u64,
    updates: u64,
    #[serde(flatten)]
    counters: K,
}

impl LearnerBase {
    /// Writes a checkpoint of this `kind`: settings, counters, the algorithm's own tensors from `put` (networks,
    /// moments, ...), the frozen decoder and prior, and the normalisers.
    ///
    /// # Errors
    /// [`FileError::Learner`] if a device does not return its numbers.
    pub(crate) fn checkpoint(
        &self,
        path: &Path,
        kind: FileKind,
        config: &impl Serialize,
        counters: &impl Serialize,
        put: impl FnOnce(&mut TensorFile) -> Result<(), FileError>,
    ) -> Result<TensorFile, FileError> {
        let teacher = self.teacher.as_ref();
        let header = Header {
            config,
            spec: self.spec,
            score: teacher.map(|teacher| teacher.config.clone()),
            skill: teacher.map(|teacher| teacher.description.clone()),
            tied_to: teacher.map(|teacher| teacher.tied_to).unwrap_or_default(),
            seed: self.streams.seed(),
            updates: self.updates,
            counters,
        };
        let mut file = TensorFile::new(path, kind, &header)?;
        let put = guarded(&self.device.plain(), || Ok(put(&mut file)));
        put.map_err(|error| FileError::Learner { path: path.to_owned(), source: error })??;
        if let Some(teacher) = teacher {
            teacher.put(&mut file)?;
        }
        put_normalizers(&mut file, self.observations.as_ref(), self.rewards.as_ref());
        Ok(file)
    }
}

/// A checkpoint that was read, with the tensors that were not taken out yet.
#[derive(Debug)]
pub(crate) struct Checkpoint<C, K> {
    pub(crate) file: TensorFile,
    pub(crate) config: C,
    pub(crate) counters: K,
    pub(crate) spec: PolicySpec,
    pub(crate) teacher: Option<Teacher>,
    pub(crate) seed: u64,
    updates: u64,
}

impl<C: DeserializeOwned, K: DeserializeOwned> Checkpoint<C, K> {
    /// Reads a checkpoint of this `kind` from `file`, and takes the frozen decoder and prior out of it.
    ///
    /// # Errors
    /// [`FileError`] describes the problem of the file, or names the tensor that is missing or misshapen.
    pub(crate) fn of(mut file: TensorFile, kind: FileKind, device: DeviceKind) -> Result<Self, FileError> {
        device.check().map_err(|e| file.learner(e))?;
        let Header { config, spec, score, skill, tied_to, seed, updates, counters }: Header<C, K> =
            file.header(kind)?;
        let teacher = match score.zip(skill) {
            None => None,
            Some((score, skill)) => Some(Teacher::take((score, tied_to), skill, spec, &mut file, device)?),
        };
        Ok(Self { file, config, counters, spec, teacher, seed, updates })
    }

    /// Restores the common state of a learner that has taken out everything else.
    ///
    /// # Errors
    /// [`FileError`] names a tensor that is missing, misshapen or superfluous.
    pub(crate) fn finish(mut self, base: &mut LearnerBase) -> Result<(), FileError> {
        take_normalizers(&mut self.file, base.observations.as_mut(), base.rewards.as_mut())?;
        base.updates = self.updates;
        self.file.finish()
    }
}
