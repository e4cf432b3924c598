//! Settings of RLPD.

use super::SacConfig;
use crate::LearnError;
use crate::error::brief_number;
use serde::{Deserialize, Serialize};

/// What RLPD adds to SAC (Ball et al. 2023, "Efficient online reinforcement learning with offline data"): recordings in each
/// batch, an ensemble of normalised critics, of which a target sees a few. Everything else is that of [`SacConfig`]; the paper
/// has 20 gradient steps per step, which [`SacConfig::updates_per_step`] says here.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields, default)]
pub struct RlpdConfig {
    /// Share of each batch that comes from the recordings.
    pub demo_share: f64,
    /// Takes the place of [`SacConfig::critics`].
    pub critics: usize,
    /// Takes the place of [`SacConfig::target_critics`].
    pub target_critics: usize,
    /// Takes the place of [`SacConfig::layer_norm`].
    pub layer_norm: bool,
}

impl Default for RlpdConfig {
    fn default() -> Self {
        Self { demo_share: 0.5, critics: 10, target_critics: 2, layer_norm: true }
    }
}

impl RlpdConfig {
    /// `Ok` if these settings can work.
    ///
    /// # Errors
    /// [`LearnError::Config`] names the first setting that cannot.
    pub fn validate(&self) -> Result<(), LearnError> {
        if !(self.demo_share > 0.0 && self.demo_share < 1.0) {
            let text = format!("rlpd demo_share must lie between 0 and 1, not {}", brief_number(self.demo_share));
            return Err(LearnError::Config(text));
        }
        let with = self.over(SacConfig::default()).validate();
        with.map_err(|error| LearnError::Config(error.to_string().replacen("config: sac ", "rlpd ", 1)))
    }

    /// The settings of SAC with these laid over them.
    #[must_use]
    pub fn over(&self, sac: SacConfig) -> SacConfig {
        let Self { critics, target_critics, layer_norm, .. } = *self;
        SacConfig { critics, target_critics, layer_norm, ..sac }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_that_cannot_work_are_named() {
        let error = |config: RlpdConfig| config.validate().expect_err("cannot work").to_string();
        let usual = RlpdConfig::default();
        assert!(usual.validate().is_ok());
        assert!(error(RlpdConfig { demo_share: 1.0, ..usual.clone() }).contains("rlpd demo_share"));
        assert!(error(RlpdConfig { target_critics: 11, ..usual }).contains("rlpd target_critics must be at most"));
    }
}
