//! The loss of the skill model, J = NLL + β KL(q ‖ p).

use crate::{
    legacy,
    nn::Dist,
    skill::{Reduction, SkillConfig, SkillForward},
};
use burn::tensor::Tensor;
use playbot_kernels::host_ops::{exp, ln};

/// The terms of the loss, `[1]` each.
#[derive(Clone, Debug)]
pub struct SkillLoss {
    /// Negative log-likelihood of the actions.
    pub nll: Tensor<1>,
    /// KL from the encoder to the prior.
    pub kl: Tensor<1>,
    /// Mean Euclidean norm of the decoder's latent.
    pub latent_norm: Tensor<1>,
    /// nll + β · kl + latent_reg · latent_norm.
    pub total: Tensor<1>,
}

/// Reduces a batch to the loss.
pub fn skill_loss(forward: &SkillForward, config: &SkillConfig) -> SkillLoss {
    let [batch, _] = forward.decoder_latent.dims();
    let nll_per_step = nll_under_noise(forward, config.action_noise);
    let (nll, kl) = match config.reduction {
        Reduction::Standard => (nll_per_step.sum() / batch as f32, forward.kl_per_sequence.clone().mean()),
        Reduction::Legacy => legacy::reduced(nll_per_step, forward.kl_per_sequence.clone()),
    };
    let latent_norm = forward.decoder_latent.clone().square().sum_dim(1).sqrt().mean();
    let mut total = nll.clone() + kl.clone() * config.beta;
    if config.latent_reg != 0.0 {
        total = total + latent_norm.clone() * config.latent_reg;
    }
    SkillLoss { nll, kl, latent_norm, total }
}

/// Returns the negative log-likelihood of each recorded action if a share ε of discrete actions was replaced by
/// uniformly random ones. It is −ln((1 − ε) π(a) + ε / K) for K legal actions. The decoder then learns the intended
/// action, not the noise. Continuous actions are not corrected.
fn nll_under_noise(forward: &SkillForward, noise: f64) -> Tensor<1> {
    let nll = forward.nll_per_step.clone();
    match &forward.decoded {
        Dist::Categorical { log_probs } if noise > 0.0 => {
            let [_, actions] = log_probs.dims();
            let meant = exp(nll.neg()) * (1.0 - noise);
            match &forward.legal_count {
                None => ln(meant + noise / actions as f64).neg(),
                Some(legal) => ln(meant + legal.clone().recip() * noise).neg(),
            }
        }
        _ => nll,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        ActionSpace, Actions, DeviceKind,
        nn::{ActionBatch, host, matrix, vector},
    };

    /// Returns the loss of three steps of one window whose decoder holds four actions equally likely.
    fn nll(noise: f64, legal: &[bool]) -> Vec<f32> {
        let device = DeviceKind::Flex.plain();
        let actions = ActionBatch::new(&Actions::Discrete(vec![1, 2, 3]), &device);
        let decoded = Dist::categorical(matrix(vec![0.5; 12], 3, 4, &device));
        let zeros = |columns| matrix(vec![0.0; columns], 1, columns, &device);
        let forward = SkillForward {
            nll_per_step: decoded.log_prob(&actions).expect("choices").neg(),
            kl_per_sequence: vector(vec![0.0], &device),
            decoder_latent: zeros(2),
            decoded,
            decoder_features: zeros(2),
            prior_features: zeros(2),
            legal_count: None,
        };
        let forward = forward.restricted(legal, ActionSpace::Discrete(4), &actions, &device).expect("choices");
        host(nll_under_noise(&forward, noise)).expect("readable")
    }

    #[test]
    fn only_legal_actions_count_in_the_likelihood_with_noise_and_without() {
        let mask = [[true; 4], [false, true, true, false], [false, false, false, true]].concat();
        for noise in [0.0, 0.5] {
            // Equal chances of 4, 2 and 1 actions, which uniform noise leaves as they are.
            for (got, chances) in nll(noise, &mask).into_iter().zip([4.0f32, 2.0, 1.0]) {
                assert!((got - libm::logf(chances)).abs() < 1e-5, "{got} of {chances}");
            }
            assert!(nll(noise, &[]).into_iter().all(|got| (got - libm::logf(4.0)).abs() < 1e-5));
        }
    }
}
