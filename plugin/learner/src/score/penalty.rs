//! The penalty for leaving the decoder: the paper's, and for comparison those of its released code.
//!
//! The latter measure KL(policy ‖ decoder) and weigh it by the decoder's density at the rollout's action. The one for
//! mazes is subtracted from the minimised loss, so it rewards the divergence until the clamp ends the gradient.

use crate::{
    Actions, LearnError,
    nn::{Dist, HostDist, argmax, categorical_at, categorical_log_prob, gaussian_log_prob, sample_gaussian},
    rng::unit,
    score::{ConfidenceKind, KlDirection, PenaltyForm, ScoreConfig},
};
use burn::tensor::Tensor;
use rand::Rng;
use rayon::prelude::*;

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
/// each row `[n]` from [`penalty_weights`].
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

// The decoder's confidence in each row, α in the paper: the weight of the row's divergence.

/// Rows that a thread takes at a time.
const ROWS: usize = 1024;

/// Returns one action per row, drawn from the decoder.
pub fn own_samples<R: Rng + ?Sized>(decoder: &HostDist, rng: &mut R) -> Actions {
    let rows = decoder.head.chunks_exact(decoder.dim);
    match &decoder.log_std {
        None => {
            let draws: Vec<f64> = rows.map(|_| unit(rng)).collect();
            let rows = decoder.head.par_chunks_exact(decoder.dim).zip(draws).with_min_len(ROWS);
            Actions::Discrete(rows.map(|(logits, draw)| categorical_at(logits, draw)).collect())
        }
        Some(stds) => {
            let stds = stds.chunks_exact(decoder.dim);
            let values = rows.zip(stds).flat_map(|(m, s)| sample_gaussian(m, s, rng)).collect();
            Actions::Continuous { dim: decoder.dim, values }
        }
    }
}

/// Returns the weight of each row of a rollout with these `actions`, by the form of the penalty and the kind of
/// confidence. `rng` draws the decoder's own samples where those are needed.
///
/// # Errors
/// [`LearnError::Action`] or [`LearnError::Shape`] if the actions do not fit the decoder.
pub fn penalty_weights<R: Rng + ?Sized>(
    config: &ScoreConfig,
    decoder: &HostDist,
    actions: &Actions,
    rng: &mut R,
) -> Result<Vec<f32>, LearnError> {
    match (config.penalty, config.confidence.resolved(decoder.log_std.is_some())) {
        (PenaltyForm::LegacyD4rl, _) => marginal_densities(decoder, actions),
        (PenaltyForm::LegacyCoinrun, _) => confidences(ConfidenceKind::PolicyAction, decoder, actions),
        (PenaltyForm::Mean, ConfidenceKind::OwnSample) => {
            confidences(ConfidenceKind::OwnSample, decoder, &own_samples(decoder, rng))
        }
        (PenaltyForm::Mean, kind) => confidences(kind, decoder, actions),
    }
}

/// Returns the confidence in each row for the given actions (of the decoder for [`ConfidenceKind::OwnSample`], else
/// of the rollout).
///
/// Discrete: the decoder's probability of the action, which [`ConfidenceKind::BoundedDensity`] divides by the largest
/// of the row. Continuous: exp(-½ · mean over dimensions of the squared z-score), in (0, 1]. For
/// [`ConfidenceKind::Density`] the density, the product over dimensions. For [`ConfidenceKind::BoundedDensity`] the
/// density relative to the mean's, exp(-½ · sum of the squared z-scores).
///
/// # Errors
/// [`LearnError::Action`] or [`LearnError::Shape`] if the actions do not fit the decoder.
pub fn confidences(kind: ConfidenceKind, decoder: &HostDist, actions: &Actions) -> Result<Vec<f32>, LearnError> {
    let (dim, kind) = (decoder.dim, kind.resolved(decoder.log_std.is_some()));
    let rows = decoder.head.par_chunks_exact(dim);
    if kind == ConfidenceKind::Off {
        return Ok(vec![1.0; rows.len()]);
    }
    LearnError::check("actions", rows.len(), actions.len())?;
    match (&decoder.log_std, actions) {
        (None, Actions::Discrete(actions)) => {
            if actions.iter().any(|&a| a as usize >= dim) {
                return Err(LearnError::Action(format!("one is not below {dim}")));
            }
            let log_prob = |(logits, &a): (&[f32], &u32)| match kind {
                ConfidenceKind::BoundedDensity => logits[a as usize] - logits[argmax(logits) as usize],
                _ => categorical_log_prob(logits, a),
            };
            Ok(rows.zip(actions).with_min_len(ROWS).map(|row| log_prob(row).exp()).collect())
        }
        (Some(stds), Actions::Continuous { dim: width, values }) if *width == dim => {
            let rows = rows.zip(stds.par_chunks_exact(dim)).zip(values.par_chunks_exact(dim));
            Ok(rows
                .with_min_len(ROWS)
                .map(|((mean, log_std), action)| match kind {
                    ConfidenceKind::Density => gaussian_log_prob(mean, log_std, action).exp(),
                    ConfidenceKind::BoundedDensity => (-0.5 * square_sum(mean, log_std, action)).exp() as f32,
                    _ => (-0.5 * square_sum(mean, log_std, action) / dim as f64).exp() as f32,
                })
                .collect())
        }
        _ => Err(LearnError::Action("decoder and actions differ in kind".to_owned())),
    }
}

/// Returns Σ ((a - μ) / σ)².
fn square_sum(mean: &[f32], log_std: &[f32], action: &[f32]) -> f64 {
    let scores = mean.iter().zip(log_std).zip(action);
    scores.map(|((&m, &s), &a)| ((f64::from(a) - f64::from(m)) * (-f64::from(s)).exp()).powi(2)).sum()
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

#[cfg(test)]
mod confidence_tests {
    use super::*;
    use crate::rng::Streams;

    fn close(got: &[f32], want: &[f64]) {
        assert_eq!(got.len(), want.len());
        let near = got.iter().zip(want).all(|(g, w)| (f64::from(*g) - w).abs() < 1e-6);
        assert!(near, "{got:?}, expected {want:?}");
    }

    #[test]
    fn discrete_by_hand() {
        let head = [0.5f32, 0.2, 0.3].map(f32::ln);
        let decoder = HostDist { dim: 3, head: [head, head].concat(), log_std: None };
        let actions = Actions::Discrete(vec![2, 0]);
        let confidence = |kind| confidences(kind, &decoder, &actions).expect("they fit");
        close(&confidence(ConfidenceKind::PolicyAction), &[0.3, 0.5]);
        close(&confidence(ConfidenceKind::Density), &[0.3, 0.5]);
        close(&confidence(ConfidenceKind::BoundedDensity), &[0.6, 1.0]);
        close(&confidence(ConfidenceKind::Off), &[1.0, 1.0]);
    }

    #[test]
    fn continuous_by_hand() {
        // z-scores 1 and 2 in the first row, none in the second.
        let ln2 = 2.0f32.ln();
        let log_std = Some(vec![0.0, ln2, 0.0, ln2]);
        let decoder = HostDist { dim: 2, head: vec![0.0, 1.0, 0.0, 1.0], log_std };
        let actions = Actions::Continuous { dim: 2, values: vec![1.0, -3.0, 0.0, 1.0] };
        let confidence = |kind| confidences(kind, &decoder, &actions).expect("they fit");
        close(&confidence(ConfidenceKind::PolicyAction), &[(-1.25f64).exp(), 1.0]);
        close(&confidence(ConfidenceKind::BoundedDensity), &[(-2.5f64).exp(), 1.0]);
        let top = 1.0 / (2.0 * std::f64::consts::TAU);
        close(&confidence(ConfidenceKind::Density), &[top * (-2.5f64).exp(), top]);
    }

    #[test]
    fn by_default_a_gaussian_tells_actions_apart() {
        let decoder = HostDist { dim: 1, head: vec![0.0, 0.0], log_std: Some(vec![0.0, 0.0]) };
        let actions = Actions::Continuous { dim: 1, values: vec![0.0, 2.0] };
        let mut rng = Streams::new(1).stream("own", 0);
        let weights = penalty_weights(&ScoreConfig::default(), &decoder, &actions, &mut rng).expect("they fit");
        close(&weights, &[1.0, (-2.0f64).exp()]);
        let own = ConfidenceKind::OwnSample;
        assert_eq!(ConfidenceKind::Auto.resolved(false), own);
        assert_eq!(own.resolved(true), own, "who asks for it gets it");
    }

    #[test]
    fn legacy_forms_have_their_own_weights() {
        let decoder = HostDist { dim: 1, head: vec![0.0], log_std: Some(vec![0.0]) };
        let actions = Actions::Continuous { dim: 1, values: vec![0.0] };
        let config = |penalty| ScoreConfig { penalty, confidence: ConfidenceKind::Off, ..ScoreConfig::default() };
        let mut rng = Streams::new(1).stream("own", 0);
        let mut weights = |penalty| penalty_weights(&config(penalty), &decoder, &actions, &mut rng).expect("they fit");
        close(&weights(PenaltyForm::Mean), &[1.0]);
        close(&weights(PenaltyForm::LegacyD4rl), &[1.0 / std::f64::consts::TAU.sqrt()]);
    }
}
