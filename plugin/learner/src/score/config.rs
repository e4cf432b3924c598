//! Settings of SCORE.

use crate::LearnError;
use crate::skill::SkillDraw;
use serde::{Deserialize, Serialize};

/// Which divergence is penalised.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum KlDirection {
    /// KL(decoder ‖ policy), the paper's.
    DecoderPolicy,
    /// KL(policy ‖ decoder), the released code's.
    PolicyDecoder,
}

/// The weight of each row's divergence: how sure the decoder is.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum AlphaKind {
    /// Always 1.
    Off,
    /// For an action drawn from the decoder: its probability, or exp(-½ mean squared z-score) if continuous.
    OwnSample,
    /// The same for the action of the rollout.
    PolicyAction,
    /// The decoder's density at the action of the rollout, unbounded if continuous.
    Density,
}

/// Where skills come from.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum PriorKind {
    /// The skill model's prior p(z | s).
    Learned,
    /// A standard normal, whatever the state (an ablation).
    StandardNormal,
}

/// Hyperparameters of SCORE. The defaults follow the paper's text.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields, default)]
pub struct ScoreConfig {
    /// Whether policy and critic read the skill z.
    pub condition: bool,
    /// Whether the policy starts as a copy of the decoder. Needs `condition`.
    pub init_from_decoder: bool,
    /// Whether leaving the decoder is penalised.
    pub kl: bool,
    /// Weight of the penalty. The paper gives none.
    pub kl_coef: f64,
    /// Which divergence is penalised.
    pub kl_direction: KlDirection,
    /// The weight of each row.
    pub alpha: AlphaKind,
    /// Whether skills are drawn or are the prior's mean.
    pub skill_draw: SkillDraw,
    /// Steps for which a skill is held (the paper's T).
    pub horizon: usize,
    /// Where skills come from.
    pub prior: PriorKind,
}

impl Default for ScoreConfig {
    fn default() -> Self {
        Self {
            condition: true,
            init_from_decoder: true,
            kl: true,
            kl_coef: 0.1,
            kl_direction: KlDirection::DecoderPolicy,
            alpha: AlphaKind::OwnSample,
            skill_draw: SkillDraw::Sample,
            horizon: 8,
            prior: PriorKind::Learned,
        }
    }
}

impl ScoreConfig {
    /// `Ok` if these settings can work.
    ///
    /// # Errors
    /// [`LearnError::Config`] names the first setting that cannot.
    pub fn validate(&self) -> Result<(), LearnError> {
        let bad = |text: String| Err(LearnError::Config(text));
        if self.init_from_decoder && !self.condition {
            return bad("score init_from_decoder needs condition: the decoder reads the skill".into());
        }
        if self.horizon == 0 {
            return bad("score horizon must be at least 1".into());
        }
        if !(self.kl_coef >= 0.0 && self.kl_coef.is_finite()) {
            return bad(format!("score kl_coef must not be negative, but is {}", self.kl_coef));
        }
        Ok(())
    }
}
