//! The interface of every learner to training.

use super::LearnerBase;
use crate::policy::Policy;
use crate::score::ScoreConfig;
use crate::skill::{Prior, SkillSource};
use crate::{FileError, LearnError, ObsSlice, PolicySpec, Rollout};
use std::fmt::Debug;
use std::path::Path;
use std::time::Duration;

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

    /// Returns the mean divergence between decoder and policy over `n` rows, in nats: exactly 0 for a policy that is
    /// still a copy of the decoder. `None` without a skill model.
    ///
    /// # Errors
    /// [`LearnError::InitialKl`] if the policy should be a copy ([`ScoreConfig::init_from_decoder`], and it was not
    /// trained yet) and the divergence is not exactly 0; [`LearnError::Shape`].
    fn initial_kl(&self, z: &[f32], obs: ObsSlice<'_>, n: usize) -> Result<Option<f32>, LearnError>;

    /// Writes the complete state, so that training continues bit for bit. The file gets a temporary name first, so a
    /// checkpoint is complete or absent.
    ///
    /// # Errors
    /// [`FileError::Io`] if it cannot be written.
    fn save(&self, path: &Path) -> Result<(), FileError>;

    /// Sets the number of updates over which a decreasing learning rate decreases, for a run that is extended. Has no
    /// effect on learners with a constant learning rate.
    fn set_total_updates(&mut self, _: Option<u64>) {}

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

    /// Returns the time spent assembling minibatches, out of rollouts or a replay buffer, since this learner was
    /// made. It is not saved.
    fn gathering(&self) -> Duration {
        self.base().gathering
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
