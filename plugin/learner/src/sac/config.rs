//! Settings of SAC.

use crate::error::brief_number;
use crate::nn::Activation;
use crate::{ActionSpace, LearnError, TimeLimit};
use serde::{Deserialize, Serialize};

/// How much entropy is worth: the temperature of the soft value, α in the papers.
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
    /// Always this.
    Fixed(f64),
}

fn one() -> f64 {
    1.0
}

/// Hyperparameters of SAC. The defaults follow the paper's Table 4 for its mazes and, where that says nothing, the
/// released code; but the temperature is tuned, as there, instead of the table's constant 0.2.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields, default)]
pub struct SacConfig {
    /// Learning rate of the actor's Adam.
    pub actor_lr: f64,
    /// Learning rate of the critics' Adam (the released code has 1e-3).
    pub critic_lr: f64,
    /// Learning rate of the temperature's Adam.
    // Its name was that of the papers, where SCORE has an α of its own.
    #[serde(alias = "alpha_lr")]
    pub temperature_lr: f64,
    /// Transitions in a gradient step, drawn with replacement.
    pub batch: usize,
    /// Transitions that are kept, the newest. Each takes 2 · (obs_dim + latent) + action width + 2 numbers of 4 bytes, and
    /// 2 more where critics count ticks, 1 where skills are chosen.
    pub buffer: usize,
    /// Transitions before the first gradient step.
    pub learning_starts: u64,
    /// Gradient steps that only the critics take, before the actor and the temperature begin. A copied policy is not led away
    /// by critics that know nothing yet.
    pub critic_warmup: u64,
    /// Whether actions are random, whatever the observation, until then: uniform (discrete) or nearly uniform in
    /// [-1, 1] (continuous). A policy that starts as a copy of the decoder plays itself instead.
    pub random_start: bool,
    /// Ticks of each environment between updates, what is played in between being one rollout.
    pub num_steps: usize,
    /// Gradient steps per new transition. What is left of a whole step is carried over to the next update.
    pub updates_per_step: f64,
    /// Gradient steps of the critics for each round of actor updates; a round then has as many updates.
    pub actor_every: u64,
    /// Share of the critics that goes into their targets: target = tau · critic + (1 - tau) · target.
    pub tau: f64,
    /// Gradient steps for each such update of the targets.
    pub target_every: u64,
    /// How many critics there are.
    pub critics: usize,
    /// How many of them, drawn for each gradient step, a target is the least of. Where that is not all of them, the actor
    /// follows the mean of all (Chen et al. 2021, "Randomized ensembled double Q-learning").
    pub target_critics: usize,
    /// Whether the critics' hidden layers are normalised, which keeps their values near what was seen.
    pub layer_norm: bool,
    /// Discount γ.
    pub gamma: f64,
    /// How much entropy is worth.
    pub entropy: EntropyCoef,
    /// Bounds of ln σ, for continuous actions.
    pub log_std: (f64, f64),
    /// What a step that ran into the time limit leads to.
    pub time_limit: TimeLimit,
    /// Whether actor and critics see observations through a normaliser of their own, which goes on learning. Not together
    /// with a copied decoder or one with [`SkillConfig::norm_obs`](crate::SkillConfig::norm_obs), whose frozen normaliser
    /// actor and critics read through too.
    pub norm_obs: bool,
    /// Whether rewards are divided by the running deviation of the discounted return.
    pub norm_reward: bool,
    /// Hidden layers of actor and critics. A copied decoder brings its own.
    pub hidden: Vec<usize>,
    /// The function after each hidden layer.
    pub activation: Activation,
    /// ε of Adam.
    pub adam_eps: f64,
}

impl Default for SacConfig {
    fn default() -> Self {
        Self {
            actor_lr: 3e-4,
            critic_lr: 3e-4,
            temperature_lr: 3e-4,
            batch: 256,
            buffer: 1_000_000,
            learning_starts: 5000,
            critic_warmup: 0,
            random_start: true,
            num_steps: 16,
            updates_per_step: 1.0,
            actor_every: 2,
            tau: 0.005,
            target_every: 1,
            critics: 2,
            target_critics: 2,
            layer_norm: false,
            gamma: 0.99,
            entropy: EntropyCoef::Auto { initial: 1.0, target_scale: None },
            log_std: (-5.0, 2.0),
            time_limit: TimeLimit::Bootstrap,
            norm_obs: false,
            norm_reward: false,
            hidden: vec![200, 200],
            activation: Activation::Relu,
            adam_eps: 1e-8,
        }
    }
}

impl SacConfig {
    /// `Ok` if these settings can work.
    ///
    /// # Errors
    /// [`LearnError::Config`] names the first setting that cannot.
    pub fn validate(&self) -> Result<(), LearnError> {
        let bad = |text: String| Err(LearnError::Config(text));
        let counts = [
            ("batch", self.batch as u64),
            ("buffer", self.buffer as u64),
            ("num_steps", self.num_steps as u64),
            ("actor_every", self.actor_every),
            ("target_every", self.target_every),
            ("critics", self.critics as u64),
            ("target_critics", self.target_critics as u64),
            ("hidden", self.hidden.iter().copied().min().unwrap_or(1) as u64),
        ];
        if let Some((name, _)) = counts.iter().find(|(_, n)| *n == 0) {
            return bad(format!("sac {name} must be at least 1"));
        }
        if self.target_critics > self.critics {
            return bad(format!(
                "sac target_critics must be at most critics = {}, not {}",
                self.critics, self.target_critics
            ));
        }
        let positive = [
            ("actor_lr", self.actor_lr),
            ("critic_lr", self.critic_lr),
            ("temperature_lr", self.temperature_lr),
            ("updates_per_step", self.updates_per_step),
            ("tau", self.tau),
            ("adam_eps", self.adam_eps),
        ];
        if let Some((name, x)) = positive.iter().find(|(_, x)| !(*x > 0.0 && x.is_finite())) {
            return bad(format!("sac {name} must be positive, not {}", brief_number(*x)));
        }
        let shares = [("gamma", self.gamma), ("tau", self.tau)];
        if let Some((name, x)) = shares.iter().find(|(_, x)| !(0.0..=1.0).contains(x)) {
            return bad(format!("sac {name} must lie in 0..1, not {}", brief_number(*x)));
        }
        let (low, high) = self.log_std;
        if !(low < high && low.abs() <= 20.0 && high.abs() <= 20.0) {
            let (low, high) = (brief_number(low), brief_number(high));
            return bad(format!("sac log_std must be two ascending numbers within ±20, not {low} and {high}"));
        }
        match self.entropy {
            EntropyCoef::Auto { initial, .. } if !(initial > 0.0 && initial.is_finite()) => {
                bad(format!("sac entropy initial must be positive, not {}", brief_number(initial)))
            }
            EntropyCoef::Auto { target_scale: Some(scale), .. } if !scale.is_finite() => {
                bad(format!("sac entropy target_scale must be finite, not {scale}"))
            }
            EntropyCoef::Fixed(temperature) if !(temperature >= 0.0 && temperature.is_finite()) => {
                bad(format!("sac entropy must not be negative, but is {}", brief_number(temperature)))
            }
            _ => Ok(()),
        }
    }

    /// The entropy in nats that the temperature is tuned for: -scale · dim (continuous) or scale · ln K (discrete); `None` if it
    /// is fixed.
    pub fn target_entropy(&self, space: ActionSpace) -> Option<f64> {
        let EntropyCoef::Auto { target_scale, .. } = self.entropy else { return None };
        Some(match space {
            ActionSpace::Continuous(dim) => -target_scale.unwrap_or(1.0) * dim as f64,
            ActionSpace::Discrete(choices) => target_scale.unwrap_or(0.89) * (choices as f64).ln(),
        })
    }
}
