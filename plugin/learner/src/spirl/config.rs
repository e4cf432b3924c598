//! Settings of SPiRL.

use crate::settings::{Range, Reader, Settings};
use crate::{LearnError, settings};

settings! {
    /// Hyperparameters of SPiRL beside those of the learner of skills, PPO or SAC, and the skill interval
    /// ([`ScoreConfig::horizon`](crate::ScoreConfig::horizon)).
    #[derive(Clone, PartialEq, Debug)]
    pub struct SpirlConfig in "spirl", read by &[Reader::SPIRL_PPO, Reader::SPIRL_SAC];

    /// Cost of leaving the prior, per nat of KL(π(z | s) ‖ p(z | s)); at the start if it is tuned.
    kl_coef: f64 = 0.1, in Range::Positive(1e6);
    /// Divergence in nats per skill that `spirl.kl_coef` is tuned for; `None` keeps it constant.
    target_kl: Option<f64> = Some(1.0), in Range::Positive(1e6);
    /// True if the decoder continues to learn below the skills, by SCORE-PPO with the settings of `ppo` and `score`.
    /// It is frozen otherwise.
    learn_decoder: bool = false;
}

impl SpirlConfig {
    /// Checks that these settings are possible.
    ///
    /// # Errors
    /// [`LearnError::Setting`] names the first impossible setting.
    pub fn validate(&self) -> Result<(), LearnError> {
        Ok(self.check_ranges()?)
    }

    /// Returns the weight after an update whose policy was `kl` nats from the prior. It is doubled or halved if that
    /// is far from the target (the adaptive penalty of Schulman et al. 2017, "Proximal policy optimization
    /// algorithms"), within bounds.
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
