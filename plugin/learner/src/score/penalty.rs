//! The penalty for leaving the decoder: the paper's, and for comparison those of its released code.
//!
//! The latter measure KL(policy ‖ decoder) and weigh it by the decoder's density at the rollout's action. The one for
//! mazes is subtracted from the minimised loss, so it rewards the divergence until the clamp ends the gradient.

use super::{KlDirection, PenaltyForm, ScoreConfig};
use crate::nn::{Dist, HostDist, gaussian_log_prob};
use crate::{Actions, LearnError};
use burn::tensor::Tensor;

/// Bound of a divergence in the released code's penalties; there is no gradient beyond.
const BOUND: f32 = 100.0;

/// Returns the divergence of each row in the configured direction, in nats, `[n]`. Exactly 0 where the two are equal.
/// `decoder` is constant.
///
/// # Errors
/// [`LearnError::Action`] if the two act in different kinds of spaces.
pub fn decoder_kl(decoder: &Dist, policy: &Dist, direction: KlDirection) -> Result<Tensor<1>, LearnError> {
    match direction {
        KlDirection::DecoderPolicy => decoder.kl(policy),
        KlDirection::PolicyDecoder => policy.kl(decoder),
    }
}

/// The penalty of a minibatch.
#[derive(Clone, Debug)]
pub struct Penalty {
    /// The divergence of each row, not weighted, in nats, `[n]`.
    pub kl: Tensor<1>,
    /// The term that, times kl_coef, is added to the minimised loss, `[1]`.
    pub term: Tensor<1>,
}

/// Returns the penalty by [`ScoreConfig::penalty`], from the constant `decoder`, the `policy`, and the `weight` of
/// each row `[n]` from [`penalty_weights`](super::penalty_weights).
///
/// # Errors
/// [`LearnError::Action`] if decoder and policy act in different kinds of spaces.
pub fn penalty(config: &ScoreConfig, decoder: &Dist, policy: &Dist, weight: Tensor<1>) -> Result<Penalty, LearnError> {
    let kl = decoder_kl(decoder, policy, config.direction())?;
    let term = match config.penalty {
        PenaltyForm::Mean => (kl.clone() * weight).mean(),
        PenaltyForm::LegacyD4rl => legacy_d4rl(kl.clone(), weight),
        PenaltyForm::LegacyCoinrun => legacy_coinrun(kl.clone(), weight),
    };
    Ok(Penalty { kl, term })
}

/// Returns -w · clamp(Σᵢ KLᵢ, ±100), `[1]`, with w = Σᵢ weightᵢ: `kl` `[n]` is KL(policy ‖ decoder), `weight` `[n]`
/// is [`marginal_densities`], a constant.
pub fn legacy_d4rl(kl: Tensor<1>, weight: Tensor<1>) -> Tensor<1> {
    weight.sum().neg() * kl.sum().clamp(-BOUND, BOUND)
}

/// Returns Σᵢ clamp(KLᵢ, ±100) · weightᵢ, `[1]`: `kl` `[n]` is KL(policy ‖ decoder), `weight` `[n]` is the decoder's
/// probability of the rollout's action, a constant.
pub fn legacy_coinrun(kl: Tensor<1>, weight: Tensor<1>) -> Tensor<1> {
    (kl.clamp(-BOUND, BOUND) * weight).sum()
}

/// Returns the sum over dimensions of the decoder's one-dimensional densities at the action of each row.
///
/// # Errors
/// [`LearnError::Shape`] or [`LearnError::Action`] if the actions do not fit a decoder of continuous actions.
pub fn marginal_densities(decoder: &HostDist, actions: &Actions) -> Result<Vec<f32>, LearnError> {
    let dim = decoder.dim;
    let (Some(stds), Actions::Continuous { dim: width, values }) = (&decoder.log_std, actions) else {
        return Err(LearnError::Action("the legacy weight for mazes needs continuous actions".to_owned()));
    };
    LearnError::check("width of the actions", dim, *width)?;
    LearnError::check("actions", decoder.head.len(), values.len())?;
    let densities = decoder.head.iter().zip(stds).zip(values);
    let densities: Vec<f32> = densities.map(|((&m, &s), &a)| gaussian_log_prob(&[m], &[s], &[a]).exp()).collect();
    Ok(densities.chunks_exact(dim).map(|row| row.iter().sum()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::{scalar, vector};

    #[test]
    fn clamps_by_hand() {
        let device = DeviceKind::Flex.plain();
        let tensor = |values: &[f32]| vector(values.to_vec(), &device);
        // Mazes: one clamp for the sum, one weight for the sum.
        let term = legacy_d4rl(tensor(&[30.0, 20.0]), tensor(&[0.5, 1.5]));
        assert_eq!(scalar(term).expect("readable"), -100.0);
        let term = legacy_d4rl(tensor(&[150.0, 20.0]), tensor(&[0.5, 1.0]));
        assert_eq!(scalar(term).expect("readable"), -150.0);
        // CoinRun: a clamp and a weight for each row.
        let term = legacy_coinrun(tensor(&[150.0, 20.0]), tensor(&[0.5, 0.25]));
        assert_eq!(scalar(term).expect("readable"), 55.0);
    }

    #[test]
    fn densities_by_hand() {
        let decoder = HostDist { dim: 2, head: vec![0.0, 1.0], log_std: Some(vec![0.0, 2.0f32.ln()]) };
        let action = Actions::Continuous { dim: 2, values: vec![1.0, 1.0] };
        // φ(1) + φ(0) / 2
        let got = marginal_densities(&decoder, &action).expect("they fit");
        assert!((got[0] - (0.241_970_7 + 0.199_471_1)).abs() < 1e-6, "{got:?}");
        assert!(marginal_densities(&decoder, &Actions::Discrete(vec![0])).is_err());
        assert!(marginal_densities(&decoder, &Actions::Continuous { dim: 2, values: vec![1.0; 4] }).is_err());
    }
}
