//! The squashed Gaussian: an action is the tanh of a normal number, stretched to the action's range.

use burn::tensor::{Device, Tensor};
use std::f64::consts::LN_2;

/// ln(2π)/2.
const HALF_LN_TAU: f64 = 0.918_938_533_204_672_8;
/// Keeps the logarithm of [`LogProbForm::Eps`] finite.
const EPS: f64 = 1e-6;

/// Returns ln σ = low + ½ (high - low) (tanh(raw) + 1): bounded, with a gradient everywhere.
pub fn bounded_log_std<const D: usize>(raw: Tensor<D>, (low, high): (f64, f64)) -> Tensor<D> {
    (raw.tanh() + 1.0) * (0.5 * (high - low)) + low
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
        let x = self.mean.clone() + self.log_std.clone().exp() * noise.clone();
        let tanh = x.clone().tanh();
        let slope = match form {
            LogProbForm::Eps => (((tanh.clone().square().neg() + 1.0) * self.scale.clone()) + EPS).log(),
            LogProbForm::Exact => {
                // Even in x, and the exponential of a number that is not positive cannot overflow.
                let distance = x.clone().abs();
                let rest = (distance.clone() * -2.0).exp().log1p();
                ((distance + rest).neg() + LN_2) * 2.0 + self.scale.clone().log()
            }
        };
        let normal = (noise.square() * 0.5 + self.log_std.clone() + HALF_LN_TAU).neg();
        SquashedDraw {
            pre_tanh: x,
            action: tanh * self.scale.clone() + self.bias.clone(),
            log_prob: (normal - slope).sum_dim(1).squeeze_dim(1),
        }
    }
}
