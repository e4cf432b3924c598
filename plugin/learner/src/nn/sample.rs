//! Sampling of actions from plain numbers, row by row.

use crate::{
    ActionSpace,
    nn::HostDist,
    rng::{normal, unit},
};
use burn::tensor::{Device, Tensor};
use playbot_kernels::host_ops::{exp, ln, ln_1p, tanh};
use rand::Rng;
use std::f64::consts::LN_2;

/// Draws an index with probabilities softmax(`logits`), by inverting the cumulative distribution with one draw.
///
/// The logits need not be normalised. An empty slice gives 0.
pub fn sample_categorical<R: Rng + ?Sized>(logits: &[f32], rng: &mut R) -> u32 {
    categorical_at(logits, unit(rng))
}

/// Returns the index at which the cumulative distribution of softmax(`logits`) exceeds `draw` in 0..1.
pub(crate) fn categorical_at(logits: &[f32], draw: f64) -> u32 {
    let top = max(logits);
    let weight = |x: f32| libm::exp(f64::from(x) - top);
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
    let total: f64 = logits.iter().map(|&x| libm::exp(f64::from(x) - top)).sum();
    (f64::from(logits[index as usize]) - top - libm::log(total)) as f32
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
    mean.iter().zip(log_std).map(|(m, s)| m + normal(rng) * libm::expf(*s)).collect()
}

/// Returns the log-density of `value`, summed over dimensions.
pub fn gaussian_log_prob(mean: &[f32], log_std: &[f32], value: &[f32]) -> f32 {
    let terms = mean.iter().zip(log_std).zip(value).map(|((&m, &s), &x)| {
        let score = (f64::from(x) - f64::from(m)) * libm::exp(-f64::from(s));
        -0.5 * score * score - f64::from(s) - HALF_LN_TAU
    });
    terms.sum::<f64>() as f32
}

/// Returns the log-density of tanh(`pre_tanh`) where `pre_tanh` is normal, summed over dimensions: ln N(x) - ln(1 -
/// tanh² x), with ln(1 - tanh² x) = 2 (ln 2 - |x| - ln(1 + e^(-2|x|))).
pub fn squashed_log_prob(mean: &[f32], log_std: &[f32], pre_tanh: &[f32]) -> f32 {
    let slope = |x: f32| {
        let x = f64::from(x).abs();
        2.0 * (std::f64::consts::LN_2 - x - libm::log1p(libm::exp(-2.0 * x)))
    };
    let slopes: f64 = pre_tanh.iter().map(|&x| slope(x)).sum();
    (f64::from(gaussian_log_prob(mean, log_std, pre_tanh)) - slopes) as f32
}

fn max(values: &[f32]) -> f64 {
    f64::from(values.iter().copied().fold(f32::NEG_INFINITY, f32::max))
}

// The squashed Gaussian: an action is the tanh of a normal number, stretched to the action's range.

/// ln(2π)/2.
const HALF_LN_TAU: f64 = 0.918_938_533_204_672_8;

/// Keeps the logarithm of [`LogProbForm::Eps`] finite.
const EPS: f64 = 1e-6;

/// Returns ln σ = low + ½ (high - low) (tanh(raw) + 1): bounded, with a gradient everywhere.
pub fn bounded_log_std<const D: usize>(raw: Tensor<D>, (low, high): (f64, f64)) -> Tensor<D> {
    (tanh(raw) + 1.0) * (0.5 * (high - low)) + low
}

/// The form of the change of volume under tanh in a log-density.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LogProbForm {
    /// ln(scale (1 - tanh² x) + 1e-6), as most implementations have it: flat where tanh saturates.
    Eps,
    /// ln(scale) + 2 (ln 2 - x - softplus(-2x)), without loss of digits.
    Exact,
}

/// One action per row and its log-density.
#[derive(Clone, Debug)]
pub struct SquashedDraw {
    /// The normal numbers x, `[n, dim]`.
    pub pre_tanh: Tensor<2>,
    /// tanh(x) · scale + bias, `[n, dim]`.
    pub action: Tensor<2>,
    /// ln of the action's density, summed over dimensions, `[n]`.
    pub log_prob: Tensor<1>,
}

/// A batch of squashed Gaussians over actions in [bias - scale, bias + scale] (Haarnoja et al. 2018, "Soft
/// actor-critic", appendix C).
#[derive(Clone, Debug)]
pub struct SquashedGaussian {
    /// Mean of the normal number x, `[n, dim]`.
    pub mean: Tensor<2>,
    /// Logarithm of its standard deviation, `[n, dim]`.
    pub log_std: Tensor<2>,
    /// Half the width of each dimension's range, `[1, dim]`.
    pub scale: Tensor<2>,
    /// The middle of each dimension's range, `[1, dim]`.
    pub bias: Tensor<2>,
}

impl SquashedGaussian {
    /// Creates squashed Gaussians over actions in [-1, 1].
    pub fn unit(mean: Tensor<2>, log_std: Tensor<2>, device: &Device) -> Self {
        let [_, dim] = mean.dims();
        Self { mean, log_std, scale: Tensor::ones([1, dim], device), bias: Tensor::zeros([1, dim], device) }
    }

    /// Draws x = mean + σ · noise squashed into an action, differentiable in mean and σ (the reparameterisation
    /// trick). `noise` is standard normal, `[n, dim]`.
    pub fn draw(&self, noise: Tensor<2>, form: LogProbForm) -> SquashedDraw {
        let x = self.mean.clone() + exp(self.log_std.clone()) * noise.clone();
        let squashed = tanh(x.clone());
        let slope = match form {
            LogProbForm::Eps => ln(((squashed.clone().square().neg() + 1.0) * self.scale.clone()) + EPS),
            LogProbForm::Exact => {
                // Even in x, and the exponential of a number that is not positive cannot overflow.
                let distance = x.clone().abs();
                let rest = ln_1p(exp(distance.clone() * -2.0));
                ((distance + rest).neg() + LN_2) * 2.0 + ln(self.scale.clone())
            }
        };
        let normal = (noise.square() * 0.5 + self.log_std.clone() + HALF_LN_TAU).neg();
        SquashedDraw {
            pre_tanh: x,
            action: squashed * self.scale.clone() + self.bias.clone(),
            log_prob: (normal - slope).sum_dim(1).squeeze_dim(1),
        }
    }
}

// A Gaussian decoder in the coordinates of a squashed Gaussian policy.

/// Bound within which actions are clamped before the inverse of tanh is applied.
const EDGE: f64 = 0.999;

/// Maps a Gaussian over actions in [-1, 1] back through tanh, to be compared with a squashed policy before its tanh.
///
/// The inverse image is not normal, so this is an approximation. The inverse of tanh is monotone and maps quantiles to
/// quantiles. The median m goes to atanh(m). σ goes to half the distance of the images of m ± σ, with m and m ± σ
/// clamped to ±0.999. For small σ this is the tangent's σ / (1 - m²). Near the edges, where that explodes, it stays a
/// width that a policy can have. Categorical distributions are unchanged, and so are several choices at once.
pub fn unsquashed(decoder: &HostDist) -> HostDist {
    let (Some(stds), ActionSpace::Continuous(_)) = (&decoder.log_std, decoder.space) else { return decoder.clone() };
    let before = |action: f64| libm::atanh(action.clamp(-EDGE, EDGE));
    let mut out = HostDist { head: Vec::new(), log_std: None, ..decoder.clone() };
    let mut log_std = Vec::with_capacity(stds.len());
    for (&mean, &log) in decoder.head.iter().zip(stds) {
        let mean = f64::from(mean).clamp(-EDGE, EDGE);
        let std = libm::exp(f64::from(log));
        let spread = 0.5 * (before(mean + std) - before(mean - std));
        out.head.push(before(mean) as f32);
        // The smallest ln σ that a state-dependent decoder can have; guards against σ that rounding makes 0.
        log_std.push(libm::log(spread).max(-10.0) as f32);
    }
    out.log_std = Some(log_std);
    out
}

/// Returns the normal number whose tanh is `action`. An action beyond ±(1 - 1e-6), which single precision cannot
/// resolve, is clamped there.
pub(crate) fn unsquashed_action(action: f32) -> f32 {
    let edge = 1.0 - 1e-6;
    libm::atanh(f64::from(action).clamp(-edge, edge)) as f32
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

    fn of(mean: f32, std: f32) -> (f32, f32) {
        let decoder = HostDist {
            space: ActionSpace::Continuous(1),
            head: vec![mean],
            log_std: Some(vec![std.ln()]),
            held: Vec::new(),
        };
        let mapped = unsquashed(&decoder);
        (mapped.head[0], mapped.log_std.expect("continuous")[0].exp())
    }

    #[test]
    fn narrow_ones_follow_the_tangent() {
        let (mean, std) = of(0.5, 0.001);
        assert!((mean - 0.5f32.atanh()).abs() < 1e-6);
        assert!((std / (0.001 / (1.0 - 0.25)) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn wide_ones_keep_their_quantiles() {
        let (mean, std) = of(-0.2, 0.5);
        assert!((mean - (-0.2f32).atanh()).abs() < 1e-6);
        assert!((std - 0.5 * (0.3f32.atanh() + 0.7f32.atanh())).abs() < 1e-6);
    }

    #[test]
    fn means_beyond_the_edge_stay_finite_and_usable() {
        for sign in [-1.0, 1.0] {
            let (mean, std) = of(7.0 * sign, 0.3);
            assert!((mean - sign * 3.8002).abs() < 1e-3);
            // Half of atanh(0.999) - atanh(0.699).
            assert!((std - 0.5 * (3.8002 - 0.8653)).abs() < 1e-2, "{std}");
        }
        let (_, std) = of(1.0, 1e-30);
        assert!(std > 0.0);
    }

    #[test]
    fn choices_are_left_alone() {
        let choices =
            HostDist { space: ActionSpace::Discrete(2), head: vec![-0.5, -0.9], log_std: None, held: Vec::new() };
        assert_eq!(unsquashed(&choices), choices);
    }
}
