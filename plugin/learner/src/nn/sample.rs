//! Sampling of actions from plain numbers, row by row.

use crate::rng::{normal, unit};
use rand::Rng;

/// Draws an index with probabilities softmax(`logits`), by inverting the cumulative distribution with one draw.
///
/// The logits need not be normalised. An empty slice gives 0.
pub fn sample_categorical<R: Rng + ?Sized>(logits: &[f32], rng: &mut R) -> u32 {
    categorical_at(logits, unit(rng))
}

/// Returns the index at which the cumulative distribution of softmax(`logits`) exceeds `draw` in 0..1.
pub(crate) fn categorical_at(logits: &[f32], draw: f64) -> u32 {
    let top = max(logits);
    let weight = |x: f32| (f64::from(x) - top).exp();
    let total: f64 = logits.iter().map(|&x| weight(x)).sum();
    let target = draw * total;
    let mut sum = 0.0;
    for (i, &x) in logits.iter().enumerate() {
        sum += weight(x);
        if target < sum {
            return i as u32;
        }
    }
    // Only rounding can lead here: the last choice that has any weight.
    logits.iter().rposition(|&x| weight(x) > 0.0).unwrap_or(0) as u32
}

/// Returns ln softmax(`logits`)\[`index`\].
///
/// # Panics
/// If `index` is not below the number of logits.
pub fn categorical_log_prob(logits: &[f32], index: u32) -> f32 {
    let top = max(logits);
    let total: f64 = logits.iter().map(|&x| (f64::from(x) - top).exp()).sum();
    (f64::from(logits[index as usize]) - top - total.ln()) as f32
}

/// Returns the index of the largest number; the first of equals, 0 of an empty slice.
pub fn argmax(values: &[f32]) -> u32 {
    let mut best = 0;
    for (i, x) in values.iter().enumerate() {
        if *x > values[best] {
            best = i;
        }
    }
    best as u32
}

/// Draws a vector from independent normal distributions, one draw per dimension.
pub fn sample_gaussian<R: Rng + ?Sized>(mean: &[f32], log_std: &[f32], rng: &mut R) -> Vec<f32> {
    mean.iter().zip(log_std).map(|(m, s)| m + normal(rng) * s.exp()).collect()
}

/// Returns the log-density of `value`, summed over dimensions.
pub fn gaussian_log_prob(mean: &[f32], log_std: &[f32], value: &[f32]) -> f32 {
    let terms = mean.iter().zip(log_std).zip(value).map(|((&m, &s), &x)| {
        let score = (f64::from(x) - f64::from(m)) * (-f64::from(s)).exp();
        -0.5 * score * score - f64::from(s) - 0.5 * std::f64::consts::TAU.ln()
    });
    terms.sum::<f64>() as f32
}

/// Returns the log-density of tanh(`pre_tanh`) where `pre_tanh` is normal, summed over dimensions: ln N(x) - ln(1 -
/// tanh² x), with ln(1 - tanh² x) = 2 (ln 2 - |x| - ln(1 + e^(-2|x|))).
pub fn squashed_log_prob(mean: &[f32], log_std: &[f32], pre_tanh: &[f32]) -> f32 {
    let slope = |x: f32| {
        let x = f64::from(x).abs();
        2.0 * (std::f64::consts::LN_2 - x - (-2.0 * x).exp().ln_1p())
    };
    let slopes: f64 = pre_tanh.iter().map(|&x| slope(x)).sum();
    (f64::from(gaussian_log_prob(mean, log_std, pre_tanh)) - slopes) as f32
}

fn max(values: &[f32]) -> f64 {
    f64::from(values.iter().copied().fold(f32::NEG_INFINITY, f32::max))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Streams;

    #[test]
    fn draws_follow_the_probabilities() {
        let probs = [0.5f32, 0.0, 0.2, 0.3];
        let logits = probs.map(|p| p.ln() + 40.0);
        let mut rng = Streams::new(1).stream("draw", 0);
        let mut counts = [0u32; 4];
        for _ in 0..20_000 {
            counts[sample_categorical(&logits, &mut rng) as usize] += 1;
        }
        assert_eq!(counts[1], 0);
        for (count, p) in counts.iter().zip(probs) {
            assert!((*count as f32 / 20_000.0 - p).abs() < 0.015);
        }
        assert!((categorical_log_prob(&logits, 2) - 0.2f32.ln()).abs() < 1e-5);
    }

    #[test]
    fn argmax_takes_the_first_of_equals() {
        assert_eq!(argmax(&[1.0, 3.0, 3.0]), 1);
        assert_eq!(argmax(&[]), 0);
    }

    #[test]
    fn gaussian_log_density_of_the_mean() {
        let got = gaussian_log_prob(&[1.0, 2.0], &[0.0, 1.0], &[1.0, 2.0]);
        assert!((got - (-1.0 - std::f32::consts::TAU.ln())).abs() < 1e-6);
    }
}
