//! Settings of SCORE.

use crate::error::brief_number;
use crate::skill::SkillDraw;
use crate::{ActionSpace, LearnError};
use serde::{Deserialize, Serialize};

/// Which divergence is penalised.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum KlDirection {
    /// KL(decoder ‖ policy), the paper's.
    DecoderPolicy,
    /// KL(policy ‖ decoder), the released code's.
    PolicyDecoder,
}

/// The weight of each row's divergence, α in the paper: how sure the decoder is of an action.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum ConfidenceKind {
    /// [`Self::OwnSample`] for discrete actions, as in the paper, and [`Self::BoundedDensity`] for continuous ones, where
    /// that would tell nothing. Where a policy of d dimensions still is the decoder the latter is 2^(-d/2) on average, so that
    /// the penalty weighs less than with the former.
    Auto,
    /// Always 1.
    Off,
    /// For an action drawn from the decoder: its probability, or exp(-½ mean squared z-score) if continuous. The latter
    /// scatters around (1 + 1/d)^(-d/2) for d dimensions in every state, since a Gaussian is equally sure of its own draws
    /// everywhere: the other kinds tell there how far an action that was taken is from what the decoder would do.
    OwnSample,
    /// The same for the action of the rollout.
    PolicyAction,
    /// The decoder's density at the action of the rollout, unbounded if continuous.
    Density,
    /// That density divided by the largest one of the row, in 0..1: p(a) / max p, or exp(-½ Σ squared z-scores) if
    /// continuous.
    BoundedDensity,
}

impl ConfidenceKind {
    /// What [`Self::Auto`] stands for with such actions; any other kind itself.
    #[must_use]
    pub fn resolved(self, is_continuous: bool) -> Self {
        match (self, is_continuous) {
            (Self::Auto, true) => Self::BoundedDensity,
            (Self::Auto, false) => Self::OwnSample,
            (kind, _) => kind,
        }
    }
}

/// How the divergences of a minibatch become one number, which times kl_coef is added to the loss.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum PenaltyForm {
    /// mean(α KL), not divided by the sum of α.
    #[default]
    Mean,
    /// The released code's for mazes: -w · clamp(Σ KL(policy ‖ decoder), ±100), where w is the sum over rows and
    /// dimensions of the decoder's one-dimensional densities at the rollout's actions. The sign is as released: it
    /// rewards the divergence. Its kl_coef is 0.001. `kl_direction` and `confidence` are not used. Continuous actions only.
    LegacyD4rl,
    /// The released code's for CoinRun: Σ p(a) clamp(KL(policy ‖ decoder), ±100), where p(a) is the decoder's
    /// probability of the rollout's action. Its kl_coef is 1e-8. `kl_direction` and `confidence` are not used. Discrete
    /// actions only.
    LegacyCoinrun,
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
    /// Where PPO takes `kl_coef` to, linearly over the whole run; it stays where it is if `None`. The decoder holds the
    /// hesitation of its demonstrators, which a policy that has learned needs no more.
    pub kl_coef_end: Option<f64>,
    /// Which divergence is penalised.
    pub kl_direction: KlDirection,
    /// The weight of each row, α in the paper.
    #[serde(rename = "alpha")]
    pub confidence: ConfidenceKind,
    /// How the rows are put together.
    pub penalty: PenaltyForm,
    /// Whether skills are drawn or are the prior's mean.
    pub skill_draw: SkillDraw,
    /// Steps for which a skill is held (the paper's T).
    pub horizon: usize,
    /// Where skills come from.
    pub prior: PriorKind,
    /// Whether critics count the ticks that are left of a skill: what (s, z) is worth depends on them. Needs `condition`.
    /// Off by default, as in the paper: neither on levels of CoinRun that were never seen nor on AntMaze Medium were its policies
    /// clearly better.
    pub critic_clock: bool,
}

impl Default for ScoreConfig {
    fn default() -> Self {
        Self {
            condition: true,
            init_from_decoder: true,
            kl: true,
            kl_coef: 0.1,
            kl_coef_end: None,
            kl_direction: KlDirection::DecoderPolicy,
            confidence: ConfidenceKind::Auto,
            penalty: PenaltyForm::Mean,
            skill_draw: SkillDraw::Sample,
            horizon: 8,
            prior: PriorKind::Learned,
            critic_clock: false,
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
        if self.critic_clock && !self.condition {
            return bad("score critic_clock needs condition: who reads no skill has no use for its ticks".into());
        }
        if self.horizon == 0 {
            return bad("score horizon must be at least 1".into());
        }
        let coefs = [("kl_coef", self.kl_coef), ("kl_coef_end", self.kl_coef_end.unwrap_or(0.0))];
        if let Some((name, x)) = coefs.iter().find(|(_, x)| !(*x >= 0.0 && x.is_finite())) {
            return bad(format!("score {name} must not be negative, but is {}", brief_number(*x)));
        }
        Ok(())
    }

    /// `Ok` if the penalty can be computed for actions of `space`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if it is a legacy form for the other kind of actions.
    pub fn check_space(&self, space: ActionSpace) -> Result<(), LearnError> {
        match (self.penalty, space) {
            (PenaltyForm::LegacyD4rl, ActionSpace::Discrete(_)) => {
                Err(LearnError::Config("score penalty LegacyD4rl is for continuous actions only".to_owned()))
            }
            (PenaltyForm::LegacyCoinrun, ActionSpace::Continuous(_)) => {
                Err(LearnError::Config("score penalty LegacyCoinrun is for discrete actions only".to_owned()))
            }
            _ => Ok(()),
        }
    }

    /// The settings of update number `update`, from 0, of `total`: with the weight that the penalty has come to.
    pub(crate) fn at(&self, update: u64, total: Option<u64>) -> Self {
        let share = total.map_or(0.0, |total| (update as f64 / total.max(1) as f64).min(1.0));
        let end = self.kl_coef_end.unwrap_or(self.kl_coef);
        Self { kl_coef: self.kl_coef + share * (end - self.kl_coef), ..self.clone() }
    }

    /// The divergence that the penalty measures.
    pub fn direction(&self) -> KlDirection {
        match self.penalty {
            PenaltyForm::Mean => self.kl_direction,
            PenaltyForm::LegacyD4rl | PenaltyForm::LegacyCoinrun => KlDirection::PolicyDecoder,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_goes_linearly_to_its_end_and_stays_there() {
        let score = ScoreConfig { kl_coef: 0.4, kl_coef_end: Some(0.0), ..ScoreConfig::default() };
        let at = |update, total| score.at(update, total).kl_coef;
        assert_eq!([at(0, Some(4)), at(2, Some(4)), at(4, Some(4)), at(9, Some(4))], [0.4, 0.2, 0.0, 0.0]);
        assert_eq!(at(3, None), 0.4, "nobody knows when the end is");
        assert_eq!(ScoreConfig::default().at(3, Some(4)), ScoreConfig::default());
    }
}
