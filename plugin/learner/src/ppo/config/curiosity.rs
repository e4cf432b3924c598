//! Settings of curiosity, a reward for what is new.

use crate::{
    SettingError,
    settings::{Number, Range},
};
use serde::{Deserialize, Serialize};

/// The intrinsic reward beside the game's.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub enum Curiosity {
    /// The agent is rewarded by the game alone.
    #[default]
    Off,
    /// Random network distillation. The defaults are those of Burda et al. 2018, with smaller networks.
    Rnd {
        /// Weight of the advantages of the game's rewards.
        #[serde(default = "two")]
        extrinsic: f64,
        /// Weight of the advantages of intrinsic rewards.
        #[serde(default = "one")]
        intrinsic: f64,
        /// Discount γ of intrinsic rewards, whose return goes on over the ends of episodes.
        #[serde(default = "gamma")]
        gamma: f64,
        /// Share of each minibatch that trains the predictor. A smaller one keeps the reward for longer.
        #[serde(default = "share")]
        share: f64,
        /// Learning rate of the predictor.
        #[serde(default = "lr")]
        lr: f64,
        /// Hidden layers of the target, behind the convolutions of `ppo.cnn` for images. The predictor has them twice.
        #[serde(default = "hidden")]
        hidden: Vec<usize>,
        /// Numbers of an observation that are predicted.
        #[serde(default = "features")]
        features: usize,
    },
}

fn two() -> f64 {
    2.0
}

fn one() -> f64 {
    1.0
}

fn gamma() -> f64 {
    0.99
}

fn share() -> f64 {
    0.25
}

fn lr() -> f64 {
    1e-4
}

fn hidden() -> Vec<usize> {
    vec![128]
}

fn features() -> usize {
    64
}

impl Curiosity {
    /// Returns random network distillation with its default settings.
    pub fn rnd() -> Self {
        Self::Rnd {
            extrinsic: two(),
            intrinsic: one(),
            gamma: gamma(),
            share: share(),
            lr: lr(),
            hidden: hidden(),
            features: features(),
        }
    }

    /// Returns these settings for steps that each take so many ticks.
    #[must_use]
    pub(crate) fn over(self, ticks: usize) -> Self {
        match self {
            Self::Off => Self::Off,
            Self::Rnd { extrinsic, intrinsic, gamma, share, lr, hidden, features } => {
                let gamma = libm::pow(gamma, ticks as f64);
                Self::Rnd { extrinsic, intrinsic, gamma, share, lr, hidden, features }
            }
        }
    }

    /// Checks that these settings are possible.
    ///
    /// # Errors
    /// [`SettingError`] names the first number outside its range.
    pub(in crate::ppo) fn check(&self) -> Result<(), SettingError> {
        let Self::Rnd { extrinsic, intrinsic, gamma, share, lr, hidden, features } = self else { return Ok(()) };
        let within = |name: &str, range: Range, number: f64| {
            let named = |fault: SettingError| SettingError { why: format!("{name} {}", fault.why), ..fault };
            range.check("ppo.curiosity", &number).map_err(named)
        };
        within("extrinsic", Range::WEIGHT, *extrinsic)?;
        within("intrinsic", Range::WEIGHT, *intrinsic)?;
        within("gamma", Range::Below(0.0, 1.0), *gamma)?;
        within("share", Range::Positive(1.0), *share)?;
        within("lr", Range::RATE, *lr)?;
        for size in hidden.iter().chain([features]) {
            Range::COUNT.check("ppo.curiosity", size).map_err(|fault| SettingError {
                value: Some(Number::Whole(*size as u64).to_string()),
                why: format!("hidden and features {}", fault.why),
                ..fault
            })?;
        }
        Ok(())
    }

    /// Returns the weights of extrinsic and intrinsic advantages.
    pub(in crate::ppo) fn weights(&self) -> (f64, f64) {
        match self {
            Self::Off => (1.0, 0.0),
            Self::Rnd { extrinsic, intrinsic, .. } => (*extrinsic, *intrinsic),
        }
    }

    /// Returns the discount of intrinsic rewards.
    pub(in crate::ppo) fn gamma(&self) -> f64 {
        match self {
            Self::Off => 0.0,
            Self::Rnd { gamma, .. } => *gamma,
        }
    }

    /// Returns the learning rate of the predictor.
    pub(in crate::ppo) fn lr(&self) -> f64 {
        match self {
            Self::Off => 0.0,
            Self::Rnd { lr, .. } => *lr,
        }
    }

    /// Returns how many of `rows` train the predictor: their share, rounded up.
    pub(in crate::ppo) fn share_of(&self, rows: usize) -> usize {
        match self {
            Self::Off => 0,
            Self::Rnd { share, .. } => ((rows as f64 * share).ceil() as usize).min(rows),
        }
    }

    /// Returns whether a network of the other settings could go on with these.
    pub(in crate::ppo) fn predicts_like(&self, other: &Self) -> bool {
        let sizes = |kind: &Self| match kind {
            Self::Off => None,
            Self::Rnd { hidden, features, .. } => Some((hidden.clone(), *features)),
        };
        match (sizes(self), sizes(other)) {
            (Some(own), Some(theirs)) => own == theirs,
            _ => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_have_defaults_and_ranges() {
        let short: Curiosity = serde_json::from_str(r#"{"Rnd":{}}"#).expect("the rest is default");
        assert_eq!(short, Curiosity::rnd());
        assert!(serde_json::from_str::<Curiosity>(r#"{"Rnd":{"shares":1}}"#).is_err());
        assert_eq!((Curiosity::default().check(), short.check()), (Ok(()), Ok(())));
        for (text, words) in [
            (r#"{"Rnd":{"gamma":1.0}}"#, "gamma must be at least 0 and below 1"),
            (r#"{"Rnd":{"share":0.0}}"#, "share must be positive"),
            (r#"{"Rnd":{"share":1.5}}"#, "share must lie in 0..1"),
            (r#"{"Rnd":{"intrinsic":-1.0}}"#, "intrinsic must not be negative"),
            (r#"{"Rnd":{"hidden":[8,0]}}"#, "hidden and features must be at least 1"),
        ] {
            let kind: Curiosity = serde_json::from_str(text).expect("its form is right");
            let error = kind.check().expect_err("impossible").to_string();
            assert!(error.starts_with("`ppo.curiosity`") && error.contains(words), "{error}");
        }
    }

    #[test]
    fn a_share_of_any_minibatch_is_one_row_at_least() {
        let kind = Curiosity::rnd();
        assert_eq!([1, 4, 5, 8].map(|rows| kind.share_of(rows)), [1, 1, 2, 2]);
    }
}
