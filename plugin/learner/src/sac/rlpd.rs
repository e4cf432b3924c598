//! Settings of RLPD.

use super::SacConfig;
use super::config::check_target_critics;
use crate::settings::{Range, Reader, Settings};
use crate::{LearnError, settings};

settings! {
    /// Settings that RLPD adds to SAC (Ball et al. 2023, "Efficient online reinforcement learning with offline
    /// data"): recordings in each batch, and an ensemble of normalised critics, some of which make a target.
    /// Everything else is in [`SacConfig`]; the paper's 20 gradient steps per step are
    /// [`SacConfig::updates_per_step`] here.
    #[derive(Clone, PartialEq, Debug)]
    pub struct RlpdConfig in "rlpd", read by &[Reader::RLPD];

    /// Share of each batch that comes from the recordings.
    demo_share: f64 = 0.5, in Range::Between(0.0, 1.0);
    /// Replaces `sac.critics`.
    critics: usize = 10, in Range::COUNT;
    /// Replaces `sac.target_critics`.
    target_critics: usize = 2, in Range::COUNT;
    /// Replaces `sac.layer_norm`.
    layer_norm: bool = true;
}

impl RlpdConfig {
    /// Checks that these settings are possible.
    ///
    /// # Errors
    /// [`LearnError::Setting`] names the first impossible setting.
    pub fn validate(&self) -> Result<(), LearnError> {
        self.check_ranges()?;
        Ok(check_target_critics("rlpd.target_critics", self.target_critics, self.critics)?)
    }

    /// Returns the settings of SAC with these in place of its own.
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
        let default = RlpdConfig::default();
        assert!(default.validate().is_ok());
        assert!(error(RlpdConfig { demo_share: 1.0, ..default.clone() }).contains("rlpd.demo_share"));
        assert!(error(RlpdConfig { target_critics: 11, ..default }).contains("`rlpd.target_critics` must be at most"));
    }
}
