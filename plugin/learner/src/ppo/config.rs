//! Settings of PPO.

use crate::error::brief_number;
use crate::nn::{Activation, CnnKind};
use crate::norm::{RewardNormalizer, RewardReset};
use crate::{Augmentation, LearnError, ObsKind, TimeLimit};
use serde::{Deserialize, Serialize};

/// Hyperparameters of PPO. The defaults are those of the paper's CoinRun runs, with 64 environments in mind.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields, default)]
pub struct PpoConfig {
    /// Learning rate of Adam.
    pub lr: f64,
    /// Whether the learning rate falls linearly to 0 over `total_updates`.
    pub anneal_lr: bool,
    /// Updates of the whole run; needed only by `anneal_lr` and by SCORE's `kl_coef_end`.
    pub total_updates: Option<u64>,
    /// Steps per environment in a rollout.
    pub num_steps: usize,
    /// Parts into which a rollout is shuffled.
    pub minibatches: usize,
    /// Passes over a rollout.
    pub epochs: usize,
    /// Discount γ.
    pub gamma: f64,
    /// λ of the generalised advantage estimate.
    pub lambda: f64,
    /// Bound of the probability ratio's distance from 1, and of the value's change if that is clipped.
    pub clip: f64,
    /// Whether the value loss is clipped too.
    pub clip_value_loss: bool,
    /// Weight of the value loss.
    pub vf_coef: f64,
    /// Weight of the entropy bonus.
    pub ent_coef: f64,
    /// Bound of the gradient's Euclidean norm over all parameters.
    pub max_grad_norm: f64,
    /// Whether advantages are normalised within each minibatch.
    pub norm_adv: bool,
    /// What a step that ran into the time limit leads to.
    pub time_limit: TimeLimit,
    /// Whether rewards are divided by the running deviation of the discounted return.
    pub norm_reward: bool,
    /// Discount of that return; γ if not given.
    pub reward_gamma: Option<f64>,
    /// When the end of an episode resets that return.
    pub reward_reset: RewardReset,
    /// Whether actor and critic see observations through a normaliser of their own, which goes on learning. Not together
    /// with a copied decoder, which reads raw ones or, by [`SkillConfig::norm_obs`](crate::SkillConfig::norm_obs), those of
    /// a frozen normaliser that actor and critic then read through too; and not for images, whose pixels are divided by
    /// 255.
    pub norm_obs: bool,
    /// Hidden layers of actor and critic. A copied decoder brings its own.
    pub hidden: Vec<usize>,
    /// The function after each hidden layer.
    pub activation: Activation,
    /// The convolutions over images, which actor and critic share. A copied decoder brings its own. Not used for vectors.
    pub cnn: CnnKind,
    /// ε of Adam.
    pub adam_eps: f64,
    /// Decoupled weight decay of Adam: a weight loses lr · weight_decay of itself in each step.
    pub weight_decay: f64,
    /// Updates in which only the critic learns: a critic that knows nothing yet would drive a policy that starts as a copy of
    /// the decoder away from it. Adam begins anew when the policy does. A weight of the penalty that falls does so from the first
    /// update on.
    pub critic_warmup: u64,
    /// Changes of images that actor and critic shall not mind (Raileanu et al. 2021, "Automatic data augmentation for
    /// generalization in reinforcement learning", DrAC); all of them at once, and none if empty.
    pub augment: Vec<Augmentation>,
    /// Weight of what they mind, the divergence of the actor and the squared error of the critic.
    pub augment_coef: f64,
    /// Whether the critic's loss trains the convolutions over images, too, or reads what they make for the policy. It never
    /// does while the critic warms up.
    pub critic_trains_cnn: bool,
}

impl Default for PpoConfig {
    fn default() -> Self {
        Self {
            lr: 5e-4,
            anneal_lr: false,
            total_updates: None,
            num_steps: 256,
            minibatches: 8,
            epochs: 3,
            gamma: 0.999,
            lambda: 0.95,
            clip: 0.2,
            clip_value_loss: true,
            vf_coef: 0.5,
            ent_coef: 0.01,
            max_grad_norm: 0.5,
            norm_adv: true,
            time_limit: TimeLimit::Bootstrap,
            norm_reward: true,
            reward_gamma: None,
            reward_reset: RewardReset::AfterStep,
            norm_obs: false,
            hidden: vec![200, 200],
            activation: Activation::Relu,
            cnn: CnnKind::default(),
            adam_eps: 1e-5,
            weight_decay: 0.0,
            critic_warmup: 0,
            augment: Vec::new(),
            augment_coef: 0.1,
            critic_trains_cnn: true,
        }
    }
}

impl PpoConfig {
    /// `Ok` if these settings can work.
    ///
    /// # Errors
    /// [`LearnError::Config`] names the first setting that cannot.
    pub fn validate(&self) -> Result<(), LearnError> {
        let bad = |text: String| Err(LearnError::Config(text));
        let counts = [
            ("num_steps", self.num_steps),
            ("minibatches", self.minibatches),
            ("epochs", self.epochs),
            ("hidden", self.hidden.iter().copied().min().unwrap_or(1)),
            ("cnn", self.cnn.smallest()),
        ];
        if let Some((name, _)) = counts.iter().find(|(_, n)| *n == 0) {
            return bad(format!("ppo {name} must be at least 1"));
        }
        let positive =
            [("lr", self.lr), ("clip", self.clip), ("max_grad_norm", self.max_grad_norm), ("adam_eps", self.adam_eps)];
        if let Some((name, x)) = positive.iter().find(|(_, x)| !(*x > 0.0 && x.is_finite())) {
            return bad(format!("ppo {name} must be positive, not {}", brief_number(*x)));
        }
        let reward_gamma = self.reward_gamma.unwrap_or(self.gamma);
        let shares = [("gamma", self.gamma), ("lambda", self.lambda), ("reward_gamma", reward_gamma)];
        if let Some((name, x)) = shares.iter().find(|(_, x)| !(0.0..=1.0).contains(x)) {
            return bad(format!("ppo {name} must lie in 0..1, not {}", brief_number(*x)));
        }
        let weights = [("vf_coef", self.vf_coef), ("ent_coef", self.ent_coef)];
        if let Some((name, x)) = weights.iter().find(|(_, x)| !x.is_finite()) {
            return bad(format!("ppo {name} must be finite, not {x}"));
        }
        let at_least_0 = [("weight_decay", self.weight_decay), ("augment_coef", self.augment_coef)];
        if let Some((name, x)) = at_least_0.iter().find(|(_, x)| !(*x >= 0.0 && x.is_finite())) {
            return bad(format!("ppo {name} must not be negative, but is {}", brief_number(*x)));
        }
        if self.anneal_lr && self.total_updates.is_none_or(|n| n == 0) {
            return bad("ppo anneal_lr needs total_updates".into());
        }
        Ok(())
    }

    /// `Ok` if such observations can be changed as these settings say.
    ///
    /// # Errors
    /// [`LearnError::Config`] names the first change that they cannot take.
    pub fn check_observation(&self, observation: &ObsKind) -> Result<(), LearnError> {
        self.augment.iter().try_for_each(|augmentation| augmentation.check("ppo augment", observation))
    }

    /// The normaliser of rewards that these settings describe.
    pub(super) fn reward_normalizer(&self) -> RewardNormalizer {
        let gamma = self.reward_gamma.unwrap_or(self.gamma);
        RewardNormalizer { reset: self.reward_reset, ..RewardNormalizer::new(gamma) }
    }

    /// The learning rate of update number `update`, from 0.
    pub fn lr_at(&self, update: u64) -> f64 {
        match self.total_updates.filter(|_| self.anneal_lr) {
            Some(total) => self.lr * (1.0 - update as f64 / total as f64).max(0.0),
            None => self.lr,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reward_normaliser_follows_its_settings() {
        let config = PpoConfig { gamma: 0.9, ..PpoConfig::default() };
        assert_eq!(config.reward_normalizer(), RewardNormalizer::new(0.9));
        let legacy = PpoConfig { reward_gamma: Some(0.5), reward_reset: RewardReset::SameStep, ..config };
        let mut normalizer = legacy.reward_normalizer();
        normalizer.normalize(&[4.0, 2.0], &[false, true], 1).expect("they fit");
        assert_eq!(normalizer.returns, [2.0]);
        normalizer.normalize(&[1.0], &[false], 1).expect("they fit");
        assert_eq!(normalizer.returns, [2.0]);
        let bad = PpoConfig { reward_gamma: Some(1.5), ..legacy };
        assert!(bad.validate().expect_err("above 1").to_string().contains("reward_gamma"));
    }
}
