//! Where a policy gets its skills in play.

use super::{Prior, SkillDraw};
use crate::policy::Policy;

/// The name of the frozen normaliser of decoder and prior in files of policies and learners.
pub(crate) const SKILL_STATS: &str = "skill.obs_norm";

/// Where a policy's skills come from, and the decoder it is tied to.
#[derive(Clone, Debug)]
pub struct SkillSource {
    /// p(z | s).
    pub prior: Prior,
    /// The skill model's decoder, without a critic; behaviour cloning if it plays instead of the policy.
    pub decoder: Policy,
    /// Ticks for which a skill is held (the paper's T).
    pub horizon: usize,
    /// Whether skills are drawn or are the prior's mean.
    pub draw: SkillDraw,
}
