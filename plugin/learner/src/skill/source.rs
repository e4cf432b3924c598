//! The source of a policy's skills in play.

use super::{Prior, SkillDraw};
use crate::policy::Policy;

/// The name of the frozen normaliser of decoder and prior in files of policies and learners.
pub(crate) const SKILL_STATS: &str = "skill.obs_norm";

/// The source of a policy's skills, and the decoder it is tied to.
#[derive(Clone, Debug)]
pub struct SkillSource {
    /// p(z | s).
    pub prior: Prior,
    /// The skill model's decoder, without a critic; behaviour cloning if it plays instead of the policy.
    pub decoder: Policy,
    /// Ticks for which one skill is used (the paper's T).
    pub horizon: usize,
    /// Draw skills at random, or use the prior's mean.
    pub draw: SkillDraw,
}
