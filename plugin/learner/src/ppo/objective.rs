//! The formulas of PPO: generalised advantage estimation on the host, and the losses as pure functions of tensors.

use crate::{
    LearnError, Rollout, TimeLimit,
    nn::{ActionBatch, Dist},
};
use burn::tensor::Tensor;
use playbot_kernels::host_ops::exp;

/// Advantages and returns, one per row of the rollout.
#[derive(Clone, Debug, PartialEq)]
pub struct Advantages {
    /// A.
    pub advantages: Vec<f32>,
    /// A + V, the target of the critic.
    pub returns: Vec<f32>,
}

/// Computes generalised advantage estimates (Schulman et al. 2016, "High-dimensional continuous control using
/// generalized advantage estimation"):
///
/// δ = r + γ v' - V(s), A = δ + γ λ (1 - done) A'. v' is 0 after a termination. After a truncation it is the value of
/// the episode's last observation (or 0 by [`TimeLimit::Legacy`]); else it is the next row's value. A step that is both
/// counts as a termination.
///
/// `rewards` take the place of the rollout's own.
///
/// # Panics
/// If the lengths do not fit; see [`Rollout::check`].
pub fn gae(rollout: &Rollout, rewards: &[f32], gamma: f64, lambda: f64, time_limit: TimeLimit) -> Advantages {
    let (steps, envs) = (rollout.steps, rollout.envs);
    let mut advantages = vec![0.0; steps * envs];
    for b in 0..envs {
        let mut following = 0.0;
        let mut next_value = f64::from(rollout.next_values[b]);
        for t in (0..steps).rev() {
            let row = t * envs + b;
            let value = f64::from(rollout.values[row]);
            let ended = rollout.terminated[row] || rollout.truncated[row];
            let bootstrap = match (ended, rollout.terminated[row], time_limit) {
                (false, _, _) => next_value,
                (true, false, TimeLimit::Bootstrap) => f64::from(rollout.final_values[row]),
                (true, _, _) => 0.0,
            };
            let delta = f64::from(rewards[row]) + gamma * bootstrap - value;
            following = delta + if ended { 0.0 } else { gamma * lambda * following };
            advantages[row] = following as f32;
            next_value = value;
        }
    }
    let returns = advantages.iter().zip(&rollout.values).map(|(a, v)| a + v).collect();
    Advantages { advantages, returns }
}

/// The constants of one minibatch, `[n]` each.
#[derive(Clone, Debug)]
pub struct PpoBatch {
    /// The actions taken.
    pub actions: ActionBatch,
    /// Their log-probabilities when taken.
    pub old_log_probs: Tensor<1>,
    /// Advantages, normalised if requested.
    pub advantages: Tensor<1>,
    /// Values when the observations were seen.
    pub old_values: Tensor<1>,
    /// Returns.
    pub returns: Tensor<1>,
}

/// The terms of the loss; `[1]` each except for the log-ratios.
#[derive(Clone, Debug)]
pub struct PpoLoss {
    /// mean(max(-A ratio, -A clip(ratio))).
    pub policy_loss: Tensor<1>,
    /// ½ mean((V - R)²), or the clipped form.
    pub value_loss: Tensor<1>,
    /// Mean entropy in nats.
    pub entropy: Tensor<1>,
    /// ln(new probability / old probability), `[n]`.
    pub log_ratio: Tensor<1>,
}

/// Computes the clipped surrogate objective, the value loss (clipped if `clip_value`) and the entropy.
///
/// The loss to minimise is policy_loss - ent_coef · entropy + vf_coef · value_loss.
///
/// # Errors
/// [`LearnError::Action`] if the actions do not fit the distribution.
pub fn ppo_loss(
    dist: &Dist,
    values: Tensor<1>,
    batch: &PpoBatch,
    clip: f64,
    clip_value: bool,
) -> Result<PpoLoss, LearnError> {
    let log_ratio = dist.log_prob(&batch.actions)? - batch.old_log_probs.clone();
    let ratio = exp(log_ratio.clone());
    let gain = batch.advantages.clone().neg();
    let clipped = ratio.clone().clamp(1.0 - clip, 1.0 + clip);
    let policy_loss = (gain.clone() * ratio).max_pair(gain * clipped).mean();

    let error = (values.clone() - batch.returns.clone()).square();
    let error = if clip_value {
        let old = batch.old_values.clone();
        let near = old.clone() + (values - old).clamp(-clip, clip);
        error.max_pair((near - batch.returns.clone()).square())
    } else {
        error
    };
    let value_loss = error.mean() * 0.5;
    Ok(PpoLoss { policy_loss, value_loss, entropy: dist.entropy().mean(), log_ratio })
}

/// Returns ½ mean((V - R)²) of the critic's second head, `[1]`, for values and returns of `[n]`.
pub fn intrinsic_value_loss(values: Tensor<1>, returns: Tensor<1>) -> Tensor<1> {
    (values - returns).square().mean() * 0.5
}

/// Normalises advantages: (A - mean) / (deviation + 1e-8) with the unbiased deviation. A single advantage becomes 0.
pub fn normalize_advantages(advantages: &mut [f32]) {
    let n = advantages.len() as f64;
    let mean = advantages.iter().map(|&a| f64::from(a)).sum::<f64>() / n;
    let squares: f64 = advantages.iter().map(|&a| (f64::from(a) - mean).powi(2)).sum();
    let std = (squares / (n - 1.0).max(1.0)).sqrt();
    for a in advantages {
        *a = ((f64::from(*a) - mean) / (std + 1e-8)) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ActionSpace, Actions};

    /// Returns advantages for one environment, two steps, γ = ½, λ = ½, V = 2 and 4, r = 1 and 3, next value 8, final
    /// value 6.
    fn advantages(terminated: bool, truncated: bool, limit: TimeLimit) -> Vec<f32> {
        let rollout = Rollout {
            steps: 2,
            obs: vec![0.0; 2].into(),
            actions: Actions::Discrete(vec![0; 2]),
            log_probs: vec![0.0; 2],
            values: vec![2.0, 4.0],
            rewards: vec![1.0, 3.0],
            terminated: vec![terminated, false],
            truncated: vec![truncated, false],
            final_values: vec![6.0, f32::NAN],
            next_values: vec![8.0],
            ..Rollout::new(1, 1, 0, &ActionSpace::Discrete(1))
        };
        gae(&rollout, &rollout.rewards, 0.5, 0.5, limit).advantages
    }

    #[test]
    fn by_hand() {
        // Second step: 3 + 8/2 - 4 = 3. Going on: 1 + 4/2 - 2 + 3/4 = 1.75.
        assert_eq!(advantages(false, false, TimeLimit::Bootstrap), [1.75, 3.0]);
        // Terminated: 1 - 2 = -1.
        assert_eq!(advantages(true, false, TimeLimit::Bootstrap), [-1.0, 3.0]);
        // Truncated: 1 + 6/2 - 2 = 2, or as a termination.
        assert_eq!(advantages(false, true, TimeLimit::Bootstrap), [2.0, 3.0]);
        assert_eq!(advantages(false, true, TimeLimit::Legacy), [-1.0, 3.0]);
        // Both: termination wins.
        assert_eq!(advantages(true, true, TimeLimit::Bootstrap), [-1.0, 3.0]);
    }
}
