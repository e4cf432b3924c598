//! α: the decoder's confidence in each row.

use super::AlphaKind;
use crate::nn::{HostDist, categorical_log_prob, gaussian_log_prob, sample_categorical, sample_gaussian};
use crate::{Actions, LearnError};
use rand::Rng;

/// One action per row, drawn from the decoder.
pub fn own_samples<R: Rng + ?Sized>(decoder: &HostDist, rng: &mut R) -> Actions {
    let rows = decoder.head.chunks_exact(decoder.dim);
    match &decoder.log_std {
        None => Actions::Discrete(rows.map(|logits| sample_categorical(logits, rng)).collect()),
        Some(stds) => {
            let stds = stds.chunks_exact(decoder.dim);
            let values = rows.zip(stds).flat_map(|(m, s)| sample_gaussian(m, s, rng)).collect();
            Actions::Continuous { dim: decoder.dim, values }
        }
    }
}

/// α of each row for the given actions (of the decoder for [`AlphaKind::OwnSample`], else of the rollout).
///
/// Discrete: the decoder's probability of the action. Continuous: exp(-½ · mean over dimensions of the squared
/// z-score), in (0, 1]; or for [`AlphaKind::Density`] the density, the product over dimensions.
///
/// # Errors
/// [`LearnError::Action`] or [`LearnError::Shape`] if the actions do not fit the decoder.
pub fn alphas(kind: AlphaKind, decoder: &HostDist, actions: &Actions) -> Result<Vec<f32>, LearnError> {
    let dim = decoder.dim;
    let rows = decoder.head.chunks_exact(dim);
    if kind == AlphaKind::Off {
        return Ok(vec![1.0; rows.len()]);
    }
    LearnError::check("actions", rows.len(), actions.len())?;
    match (&decoder.log_std, actions) {
        (None, Actions::Discrete(actions)) => {
            if actions.iter().any(|&a| a as usize >= dim) {
                return Err(LearnError::Action(format!("one is not below {dim}")));
            }
            Ok(rows.zip(actions).map(|(logits, &a)| categorical_log_prob(logits, a).exp()).collect())
        }
        (Some(stds), Actions::Continuous { dim: width, values }) if *width == dim => {
            let rows = rows.zip(stds.chunks_exact(dim)).zip(values.chunks_exact(dim));
            Ok(rows
                .map(|((mean, log_std), action)| match kind {
                    AlphaKind::Density => gaussian_log_prob(mean, log_std, action).exp(),
                    _ => score(mean, log_std, action),
                })
                .collect())
        }
        _ => Err(LearnError::Action("decoder and actions differ in kind".to_owned())),
    }
}

fn score(mean: &[f32], log_std: &[f32], action: &[f32]) -> f32 {
    let squares = mean
        .iter()
        .zip(log_std)
        .zip(action)
        .map(|((&m, &s), &a)| ((f64::from(a) - f64::from(m)) * (-f64::from(s)).exp()).powi(2));
    (-0.5 * squares.sum::<f64>() / mean.len() as f64).exp() as f32
}
