//! Settings of SCORE.

use crate::{
    ActionSpace, LearnError, SettingError, settings,
    settings::{Range, Reader, Settings},
    skill::SkillDraw,
};
use serde::{Deserialize, Serialize};

/// The penalised divergence.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum KlDirection {
    /// KL(decoder ‖ policy), the paper's.
    DecoderPolicy,
    /// KL(policy ‖ decoder), the released code's.
    PolicyDecoder,
}

/// The weight of each row's divergence, α in the paper: the decoder's confidence in an action.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum ConfidenceKind {
    /// [`Self::OwnSample`] for discrete actions, as in the paper, and [`Self::BoundedDensity`] for continuous ones,
    /// where the former carries no information. For a policy of d dimensions that still is the decoder, the latter is
    /// 2^(-d/2) on average, so the penalty weighs less than with the former.
    Auto,
    /// Always 1.
    Off,
    /// For an action drawn from the decoder: its probability, or exp(-½ mean squared z-score) if continuous. The
    /// latter scatters around (1 + 1/d)^(-d/2) for d dimensions in every state, since a Gaussian is equally confident
    /// of its own draws everywhere. The other kinds measure how far the action taken is from the decoder's.
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
    /// Returns the kind that [`Self::Auto`] stands for with such actions; any other kind unchanged.
    #[must_use]
    pub fn resolved(self, is_continuous: bool) -> Self {
        match (self, is_continuous) {
            (Self::Auto, true) => Self::BoundedDensity,
            (Self::Auto, false) => Self::OwnSample,
            (kind, _) => kind,
        }
    }
}

/// The reduction of a minibatch's divergences to one number, which times kl_coef is added to the loss.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum PenaltyForm {
    /// mean(α KL), not divided by the sum of α.
    #[default]
    Mean,
    /// The released code's for mazes: -w · clamp(Σ KL(policy ‖ decoder), ±100), where w is the sum over rows and
    /// dimensions of the decoder's one-dimensional densities at the rollout's actions. The sign is as released: it
    /// rewards the divergence. Its kl_coef is 0.001. `kl_direction` and `confidence` are not used. Continuous actions
    /// only.
    LegacyD4rl,
    /// The released code's for CoinRun: Σ p(a) clamp(KL(policy ‖ decoder), ±100), where p(a) is the decoder's
    /// probability of the rollout's action. Its kl_coef is 1e-8. `kl_direction` and `confidence` are not used. Discrete
    /// actions only.
    LegacyCoinrun,
}

/// The source of skills.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum PriorKind {
    /// The skill model's prior p(z | s).
    Learned,
    /// A standard normal, whatever the state (an ablation).
    StandardNormal,
}

/// The algorithms whose policy over actions is tied to a decoder.
const TIED: &[Reader] = &[Reader::SCORE_PPO, Reader::SCORE_SAC, Reader::SPIRL_PPO_DECODER, Reader::SPIRL_SAC_DECODER];

/// Those that are trained with skills.
const TRAINED: &[Reader] = &[Reader::SCORE_PPO, Reader::SCORE_SAC, Reader::SPIRL_PPO, Reader::SPIRL_SAC];

settings! {
    /// Hyperparameters of SCORE. The defaults follow the paper's text.
    #[derive(Clone, PartialEq, Debug)]
    pub struct ScoreConfig in "score", read by TIED;

    /// True if policy and critic read the skill z.
    condition: bool = true;
    /// True if the policy starts as a copy of the decoder. Needs `score.condition`.
    init_from_decoder: bool = true;
    /// True if leaving the decoder is penalised.
    kl: bool = true;
    /// Weight of the penalty. The paper gives none.
    kl_coef: f64 = 0.1, in Range::WEIGHT;
    /// Weight of the penalty at the end of the run, which PPO approaches linearly; `None` keeps `score.kl_coef`. The
    /// decoder holds the hesitation of its demonstrators, which a trained policy no longer needs.
    kl_coef_end: Option<f64> = None, in Range::WEIGHT;
    /// The penalised divergence.
    kl_direction: KlDirection = KlDirection::DecoderPolicy;
    /// Weight of each row of the penalty, α in the paper.
    confidence as "alpha": ConfidenceKind = ConfidenceKind::Auto;
    /// The reduction over rows.
    penalty: PenaltyForm = PenaltyForm::Mean;
    /// Draw skills at random, or use the prior's mean.
    skill_draw: SkillDraw = SkillDraw::Sample, by Reader::WITH_SKILLS;
    /// Ticks for which one skill is used (the paper's T).
    skill_interval as "horizon": usize = 8, in Range::COUNT, by Reader::WITH_SKILLS;
    /// The source of skills.
    prior: PriorKind = PriorKind::Learned, by TRAINED;
    /// True if critics read the remaining ticks of a skill, on which the value of (s, z) depends. Needs
    /// `score.condition`. Off by default, as in the paper: its policies were not clearly better on unseen levels of
    /// CoinRun or on AntMaze Medium.
    critic_clock: bool = false;
}

impl ScoreConfig {
    /// Checks that these settings are possible.
    ///
    /// # Errors
    /// [`LearnError::Setting`] names the first impossible setting.
    pub fn validate(&self) -> Result<(), LearnError> {
        let needs_condition = [
            ("score.init_from_decoder", self.init_from_decoder, "the decoder reads the skill"),
            ("score.critic_clock", self.critic_clock, "a critic that reads no skill has no use for its ticks"),
        ];
        if let Some(&(path, _, why)) = needs_condition.iter().find(|(_, on, _)| *on && !self.condition) {
            return Err(SettingError::new(path, format!("needs `score.condition`: {why}")).into());
        }
        Ok(self.check_ranges()?)
    }

    /// Checks that the penalty can be computed for actions of `space`.
    ///
    /// # Errors
    /// [`LearnError::Setting`] if it is a legacy form for the other kind of actions.
    pub fn check_space(&self, space: ActionSpace) -> Result<(), LearnError> {
        match (self.penalty, space) {
            (PenaltyForm::LegacyD4rl, ActionSpace::Discrete(_) | ActionSpace::Mixed(_)) => {
                Err(SettingError::new("score.penalty", "LegacyD4rl is for continuous actions only").into())
            }
            (PenaltyForm::LegacyCoinrun, ActionSpace::Continuous(_) | ActionSpace::Mixed(_)) => {
                Err(SettingError::new("score.penalty", "LegacyCoinrun is for discrete actions only").into())
            }
            _ => Ok(()),
        }
    }

    /// Returns the settings of update number `update`, from 0, of `total`, with the present weight of the penalty.
    pub(crate) fn at(&self, update: u64, total: Option<u64>) -> Self {
        let share = total.map_or(0.0, |total| (update as f64 / total.max(1) as f64).min(1.0));
        let end = self.kl_coef_end.unwrap_or(self.kl_coef);
        Self { kl_coef: self.kl_coef + share * (end - self.kl_coef), ..self.clone() }
    }

    /// Returns the divergence that the penalty measures.
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
        assert_eq!(at(3, None), 0.4, "the end is unknown");
        assert_eq!(ScoreConfig::default().at(3, Some(4)), ScoreConfig::default());
    }
}
