//! Settings of SAC.

use crate::{
    ActionSpace, LearnError, SettingError, TimeLimit,
    error::brief_number,
    settings,
    settings::{Range, Reader, Settings},
};
use playbot_kernels::elementwise::Activation;
use serde::{Deserialize, Serialize};

/// The temperature of the soft value, α in the papers: the weight of entropy.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
#[serde(deny_unknown_fields)]
pub enum EntropyCoef {
    /// Tuned so that the policy's entropy comes near a target (Haarnoja et al. 2018, "Soft actor-critic algorithms and
    /// applications").
    Auto {
        /// The temperature at the start.
        #[serde(default = "one")]
        initial: f64,
        /// The target in units of -dim (continuous; 1 if `None`) or of ln K, the entropy of K equal choices (discrete;
        /// 0.89 if `None`).
        #[serde(default)]
        target_scale: Option<f64>,
    },
    /// This constant.
    Fixed(f64),
}

fn one() -> f64 {
    1.0
}

/// The algorithms that learn by SAC.
const SAC: &[Reader] = &[Reader::SCORE_SAC, Reader::SAC, Reader::SPIRL_SAC, Reader::RLPD];

/// Those of them that set their critics here.
const NOT_RLPD: &[Reader] = &[Reader::SCORE_SAC, Reader::SAC, Reader::SPIRL_SAC];

/// Those of them whose policy is over actions.
const OVER_ACTIONS: &[Reader] = &[Reader::SCORE_SAC, Reader::SAC, Reader::RLPD];

settings! {
    /// Hyperparameters of SAC. The defaults follow the paper's Table 4 for its mazes and, where that is silent, the
    /// released code; but the temperature is tuned, as there, instead of the table's constant 0.2.
    #[derive(Clone, PartialEq, Debug)]
    pub struct SacConfig in "sac", read by SAC;

    /// Learning rate of the actor's Adam.
    actor_lr: f64 = 3e-4, in Range::RATE;
    /// Learning rate of the critics' Adam (the released code has 1e-3).
    critic_lr: f64 = 3e-4, in Range::RATE;
    /// Learning rate of the temperature's Adam.
    // The field's name was that of the papers, where SCORE has an α of its own.
    temperature_lr once "alpha_lr": f64 = 3e-4, in Range::RATE;
    /// Transitions in a gradient step, drawn with replacement.
    batch: usize = 256, in Range::COUNT;
    /// Capacity in transitions; the newest are kept. Each takes 2 · (obs_dim + latent) + action width + 2 numbers of
    /// 4 bytes, and 2 more if critics count ticks, 1 if skills are the actions.
    buffer: usize = 1_000_000, in Range::COUNT;
    /// Transitions before the first gradient step.
    learning_starts: u64 = 5000;
    /// Gradient steps of the critics alone, before the actor and the temperature begin. Untrained critics would
    /// mislead a copied policy.
    critic_warmup: u64 = 0;
    /// True if actions are random, whatever the observation, until `sac.learning_starts`: uniform (discrete) or
    /// nearly uniform in [-1, 1] (continuous). A policy that starts as a copy of the decoder plays itself instead.
    random_start: bool = true, by OVER_ACTIONS;
    /// Ticks of each environment between updates; they make one rollout.
    num_steps: usize = 16, in Range::COUNT;
    /// Gradient steps per new transition. The fraction of a step is carried over to the next update.
    updates_per_step: f64 = 1.0, in Range::Positive(1e4);
    /// Gradient steps of the critics for each round of actor updates; a round then has as many updates.
    actor_every: u64 = 2, in Range::COUNT;
    /// Share of the critics that goes into their targets: target = tau · critic + (1 - tau) · target.
    tau: f64 = 0.005, in Range::Positive(1.0);
    /// Gradient steps for each such update of the targets.
    target_every: u64 = 1, in Range::COUNT;
    /// Number of critics.
    critics: usize = 2, in Range::COUNT, by NOT_RLPD;
    /// Number of critics, drawn for each gradient step, whose least value is the target. With fewer than
    /// `sac.critics`, the actor follows the mean of all (Chen et al. 2021, "Randomized ensembled double Q-learning").
    target_critics: usize = 2, in Range::COUNT, by NOT_RLPD;
    /// True if the critics' hidden layers are normalised, which keeps their values near the observed ones.
    layer_norm: bool = false, by NOT_RLPD;
    /// Discount γ.
    gamma: f64 = 0.99, in Range::SHARE;
    /// Weight of entropy: a temperature, `Fixed` or tuned by `Auto`.
    entropy: EntropyCoef = EntropyCoef::Auto { initial: 1.0, target_scale: None },
        within "`initial` above 0, `Fixed` not negative, at most 1000000; `target_scale` within ±1000000", by OVER_ACTIONS;
    /// Bounds of ln σ, for continuous actions.
    log_std: (f64, f64) = (-5.0, 2.0), within "two ascending numbers within ±20";
    /// Treatment of a step that reached the time limit.
    time_limit: TimeLimit = TimeLimit::Bootstrap;
    /// True if actor and critics normalise observations by running statistics of their own. It cannot be combined
    /// with a copied decoder or with `skills.norm_obs`, whose frozen statistics actor and critics use too.
    norm_obs: bool = false;
    /// True if rewards are divided by the running deviation of the discounted return.
    norm_reward: bool = false;
    /// Hidden layers of actor and critics. A copied decoder brings its own.
    hidden: Vec<usize> = vec![200, 200], in Range::COUNT;
    /// The function after each hidden layer.
    activation: Activation = Activation::Relu;
    /// ε of Adam.
    adam_eps: f64 = 1e-8, in Range::Positive(1.0);
}

impl SacConfig {
    /// Checks that these settings are possible.
    ///
    /// # Errors
    /// [`LearnError::Setting`] names the first impossible setting.
    pub fn validate(&self) -> Result<(), LearnError> {
        self.check_ranges()?;
        check_target_critics("sac.target_critics", self.target_critics, self.critics)?;
        let (low, high) = self.log_std;
        if !(low < high && low.abs() <= 20.0 && high.abs() <= 20.0) {
            let (low, high) = (brief_number(low), brief_number(high));
            let why = format!("must be two ascending numbers within ±20, not {low} and {high}");
            return Err(SettingError::new("sac.log_std", why).into());
        }
        Ok(self.check_entropy()?)
    }

    fn check_entropy(&self) -> Result<(), SettingError> {
        let within = |name: &str, range: Range, number: f64| {
            let named = |fault: SettingError| SettingError { why: format!("{name}{}", fault.why), ..fault };
            range.check("sac.entropy", &number).map_err(named)
        };
        match self.entropy {
            EntropyCoef::Auto { initial, target_scale } => {
                within("initial ", Range::Positive(1e6), initial)?;
                within("target_scale ", Range::Within(-1e6, 1e6), target_scale.unwrap_or(0.0))
            }
            EntropyCoef::Fixed(temperature) => within("", Range::WEIGHT, temperature),
        }
    }

    /// Returns the target entropy of the temperature in nats: -scale · dim (continuous) or scale · ln K (discrete);
    /// `None` if it is fixed.
    pub fn target_entropy(&self, space: ActionSpace) -> Option<f64> {
        let EntropyCoef::Auto { target_scale, .. } = self.entropy else { return None };
        Some(match space {
            ActionSpace::Continuous(dim) => -target_scale.unwrap_or(1.0) * dim as f64,
            ActionSpace::Discrete(choices) => target_scale.unwrap_or(0.89) * libm::log(choices as f64),
            // `check_space` refuses them.
            ActionSpace::Mixed(_) => return None,
        })
    }

    /// Checks that SAC can learn actions of `space`: one choice, or a vector.
    ///
    /// # Errors
    /// [`LearnError::Config`] for several choices at once.
    pub fn check_space(&self, space: ActionSpace) -> Result<(), LearnError> {
        match space {
            ActionSpace::Discrete(_) | ActionSpace::Continuous(_) => Ok(()),
            ActionSpace::Mixed(_) => Err(LearnError::Config(format!(
                "SAC and RLPD learn one choice or a vector, not {space}: choose the algorithm ppo, score-ppo or spirl"
            ))),
        }
    }
}

/// Checks that there are as many critics as a target needs.
pub(super) fn check_target_critics(path: &'static str, targets: usize, critics: usize) -> Result<(), SettingError> {
    if targets <= critics {
        return Ok(());
    }
    Err(SettingError::new(path, format!("must be at most critics = {critics}, not {targets}")))
}

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
