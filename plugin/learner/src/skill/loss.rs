//! The loss of the skill model, J = NLL + β KL(q ‖ p).

use crate::{
    legacy,
    nn::Dist,
    skill::{Reduction, SkillConfig, SkillForward},
};
use burn::tensor::Tensor;

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
/// uniformly random ones. It is −ln((1 − ε) π(a) + ε / K) for K actions. The decoder then learns the intended action,
/// not the noise. Continuous actions are not corrected.
fn nll_under_noise(forward: &SkillForward, noise: f64) -> Tensor<1> {
    let nll = forward.nll_per_step.clone();
    match &forward.decoded {
        Dist::Categorical { log_probs } if noise > 0.0 => {
            let [_, actions] = log_probs.dims();
            let meant = nll.neg().exp() * (1.0 - noise);
            (meant + noise / actions as f64).log().neg()
        }
        _ => nll,
    }
}
