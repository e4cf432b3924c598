//! Forms of the paper's released code that differ from the paper's text.
//!
//! They are here for comparison: the presets `*-released` ask for them, and golden cases compare them with numbers of
//! the original program. One more is a single comparison where it is needed: by [`TimeLimit::Legacy`] a step that
//! reached the time limit counts as a termination.
//!
//! [`TimeLimit::Legacy`]: crate::TimeLimit::Legacy

use crate::{
    Actions, LearnError,
    nn::{HostDist, gaussian_log_prob},
    rng::below,
};
use burn::tensor::Tensor;
use rand::Rng;

/// Bound of every clamp of the released code; there is no gradient beyond.
const BOUND: f32 = 100.0;

/// Returns -w · clamp(Σᵢ KLᵢ, ±100), `[1]`, with w = Σᵢ weightᵢ, the penalty [`PenaltyForm::LegacyD4rl`]: `kl` `[n]` is
/// KL(policy ‖ decoder), `weight` `[n]` is [`marginal_densities`], a constant.
///
/// It is part of the minimised loss, so it rewards the divergence until the clamp ends the gradient.
///
/// [`PenaltyForm::LegacyD4rl`]: crate::PenaltyForm::LegacyD4rl
pub fn d4rl_penalty(kl: Tensor<1>, weight: Tensor<1>) -> Tensor<1> {
    weight.sum().neg() * kl.sum().clamp(-BOUND, BOUND)
}

/// Returns Σᵢ clamp(KLᵢ, ±100) · weightᵢ, `[1]`, the penalty [`PenaltyForm::LegacyCoinrun`]: `kl` `[n]` is
/// KL(policy ‖ decoder), `weight` `[n]` is the decoder's probability of the rollout's action, a constant.
///
/// [`PenaltyForm::LegacyCoinrun`]: crate::PenaltyForm::LegacyCoinrun
pub fn coinrun_penalty(kl: Tensor<1>, weight: Tensor<1>) -> Tensor<1> {
    (kl.clamp(-BOUND, BOUND) * weight).sum()
}

/// Returns the weights of [`d4rl_penalty`]: the sum over dimensions of the decoder's one-dimensional densities at the
/// action of each row.
///
/// # Errors
/// [`LearnError::Shape`] or [`LearnError::Action`] if the actions do not fit a decoder of continuous actions.
pub fn marginal_densities(decoder: &HostDist, actions: &Actions) -> Result<Vec<f32>, LearnError> {
    let dim = decoder.dim();
    let (Some(stds), Actions::Continuous { dim: width, values }) = (&decoder.log_std, actions) else {
        return Err(LearnError::Action("the legacy weight for mazes needs continuous actions".to_owned()));
    };
    LearnError::check("width of the actions", dim, *width)?;
    LearnError::check("actions", decoder.head.len(), values.len())?;
    let densities = decoder.head.iter().zip(stds).zip(values);
    let densities: Vec<f32> = densities.map(|((&m, &s), &a)| libm::expf(gaussian_log_prob(&[m], &[s], &[a]))).collect();
    Ok(densities.chunks_exact(dim).map(|row| row.iter().sum()).collect())
}

/// Returns the terms of the skill model's loss by [`Reduction::Legacy`], `[1]` each: the mean of the negative
/// log-likelihood of each step `[n]`, and the sum of the divergence of each sequence `[b]`, both clamped.
///
/// [`Reduction::Legacy`]: crate::Reduction::Legacy
pub fn reduced(nll_per_step: Tensor<1>, kl_per_sequence: Tensor<1>) -> (Tensor<1>, Tensor<1>) {
    (nll_per_step.mean().clamp(-BOUND, BOUND), kl_per_sequence.sum().clamp(-BOUND, BOUND))
}

/// Returns the first steps of the windows by [`WindowRule::Legacy`], in `steps` steps of all episodes laid end to end.
/// There are as many as fit side by side, each drawn uniformly, whatever was drawn before. Empty if none fits.
///
/// [`WindowRule::Legacy`]: crate::WindowRule::Legacy
pub fn window_starts<R: Rng + ?Sized>(steps: usize, window: usize, rng: &mut R) -> Vec<usize> {
    let Some(slack) = steps.checked_sub(window).filter(|_| window > 0) else { return Vec::new() };
    (0..steps / window).map(|_| below(rng, slack as u64 + 1) as usize).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ActionSpace;
    use crate::DeviceKind;
    use crate::nn::{scalar, vector};

    #[test]
    fn clamps_by_hand() {
        let device = DeviceKind::Flex.plain();
        let tensor = |values: &[f32]| vector(values.to_vec(), &device);
        // Mazes: one clamp for the sum, one weight for the sum.
        let term = d4rl_penalty(tensor(&[30.0, 20.0]), tensor(&[0.5, 1.5]));
        assert_eq!(scalar(term).expect("readable"), -100.0);
        let term = d4rl_penalty(tensor(&[150.0, 20.0]), tensor(&[0.5, 1.0]));
        assert_eq!(scalar(term).expect("readable"), -150.0);
        // CoinRun: a clamp and a weight for each row.
        let term = coinrun_penalty(tensor(&[150.0, 20.0]), tensor(&[0.5, 0.25]));
        assert_eq!(scalar(term).expect("readable"), 55.0);
    }

    #[test]
    fn densities_by_hand() {
        let decoder = HostDist {
            space: ActionSpace::Continuous(2),
            head: vec![0.0, 1.0],
            log_std: Some(vec![0.0, std::f32::consts::LN_2]),
            held: Vec::new(),
        };
        let action = Actions::Continuous { dim: 2, values: vec![1.0, 1.0] };
        // φ(1) + φ(0) / 2
        let got = marginal_densities(&decoder, &action).expect("they fit");
        assert!((got[0] - (0.241_970_7 + 0.199_471_1)).abs() < 1e-6, "{got:?}");
        assert!(marginal_densities(&decoder, &Actions::Discrete(vec![0])).is_err());
        assert!(marginal_densities(&decoder, &Actions::Continuous { dim: 2, values: vec![1.0; 4] }).is_err());
    }
}
