//! Settings of SPiRL.

use crate::LearnError;
use crate::error::brief_number;
use serde::{Deserialize, Serialize};

/// Hyperparameters of SPiRL beside those of the learner of skills, PPO or SAC, and the ticks for which a skill is held
/// ([`ScoreConfig::horizon`](crate::ScoreConfig::horizon)).
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields, default)]
pub struct SpirlConfig {
    /// How much leaving the prior costs, per nat of KL(π(z | s) ‖ p(z | s)); at the start if it is tuned.
    pub kl_coef: f64,
    /// The divergence in nats per skill that `kl_coef` is tuned for; `None` leaves it as it is.
    pub target_kl: Option<f64>,
    /// Whether the decoder goes on learning below the skills, by SCORE-PPO with the settings of `ppo` and `score`; else it is
    /// frozen.
    pub learn_decoder: bool,
}

impl Default for SpirlConfig {
    fn default() -> Self {
        Self { kl_coef: 0.1, target_kl: Some(1.0), learn_decoder: false }
    }
}

impl SpirlConfig {
    /// `Ok` if these settings can work.
    ///
    /// # Errors
    /// [`LearnError::Config`] names the first setting that cannot.
    pub fn validate(&self) -> Result<(), LearnError> {
        let bad = |text: String| Err(LearnError::Config(text));
        if !(self.kl_coef > 0.0 && self.kl_coef.is_finite()) {
            return bad(format!("spirl kl_coef must be positive, not {}", brief_number(self.kl_coef)));
        }
        match self.target_kl {
            Some(target) if !(target > 0.0 && target.is_finite()) => {
                let target = brief_number(target);
                bad(format!("spirl target_kl must be positive, not {target}; `None` leaves kl_coef as it is"))
            }
            _ => Ok(()),
        }
    }

    /// The weight after an update whose policy was `kl` nats from the prior: twice or half of it where that is far from the
    /// target (the adaptive penalty of Schulman et al. 2017, "Proximal policy optimization algorithms"), within bounds.
    pub(super) fn tuned(&self, kl_coef: f64, kl: f64) -> f64 {
        const FAR: f64 = 1.5;
        const BOUNDS: (f64, f64) = (1e-6, 1e3);
        match self.target_kl {
            Some(target) if kl > FAR * target => (kl_coef * 2.0).min(BOUNDS.1),
            Some(target) if kl < target / FAR => (kl_coef / 2.0).max(BOUNDS.0),
            _ => kl_coef,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_follows_the_divergence() {
        let config = SpirlConfig { target_kl: Some(2.0), ..SpirlConfig::default() };
        assert_eq!([4.0, 2.0, 1.0].map(|kl| config.tuned(0.5, kl)), [1.0, 0.5, 0.25]);
        assert_eq!((config.tuned(1e-6, 0.0), config.tuned(1e3, 9.0)), (1e-6, 1e3));
        assert_eq!(SpirlConfig { target_kl: None, ..config }.tuned(0.5, 9.0), 0.5);
    }

    #[test]
    fn settings_that_cannot_work_are_named() {
        let error = |config: SpirlConfig| config.validate().expect_err("cannot work").to_string();
        assert!(error(SpirlConfig { kl_coef: 0.0, ..SpirlConfig::default() }).contains("kl_coef"));
        assert!(error(SpirlConfig { target_kl: Some(f64::NAN), ..SpirlConfig::default() }).contains("target_kl"));
        assert!(SpirlConfig::default().validate().is_ok());
    }
}
