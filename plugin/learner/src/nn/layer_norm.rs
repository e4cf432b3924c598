//! Layer normalisation.

use super::params::{ParamVisitor, Parameters, path};
use super::source::{Init, ParamSource};
use burn::tensor::Tensor;

/// Added to the variance.
const EPS: f64 = 1e-6;

/// Brings each row to mean 0 and deviation 1, then scales and shifts each column (Ba et al. 2016, "Layer normalization"):
/// y = (x - mean) / √(var + 1e-6) · scale + shift.
#[derive(Clone, Debug)]
pub struct LayerNorm {
    /// `[width]`, ones at first.
    pub scale: Tensor<1>,
    /// `[width]`, zeros at first.
    pub shift: Tensor<1>,
}

impl LayerNorm {
    pub(crate) fn build<S: ParamSource>(source: &mut S, prefix: &str, width: usize) -> Result<Self, S::Error> {
        Ok(Self {
            scale: source.param(&path(prefix, "scale"), [width], Init::Ones)?,
            shift: source.param(&path(prefix, "shift"), [width], Init::Zeros)?,
        })
    }

    /// Maps `[n, width]` to `[n, width]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        let centred = x.clone() - x.mean_dim(1);
        let deviation = (centred.clone().square().mean_dim(1) + EPS).sqrt();
        centred / deviation * self.scale.clone().unsqueeze::<2>() + self.shift.clone().unsqueeze::<2>()
    }
}

impl Parameters for LayerNorm {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        visitor.visit(&path(prefix, "scale"), &mut self.scale);
        visitor.visit(&path(prefix, "shift"), &mut self.shift);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::{host, matrix, vector};

    #[test]
    fn by_hand() {
        let device = DeviceKind::Flex.plain();
        let norm =
            LayerNorm { scale: vector(vec![1.0, 2.0, 1.0], &device), shift: vector(vec![0.0, 0.5, 0.0], &device) };
        let rows = norm.forward(matrix(vec![1.0, 2.0, 3.0, 5.0, 5.0, 5.0], 2, 3, &device));
        let side = (1.5f32).sqrt();
        let expected = [-side, 0.5, side, 0.0, 0.5, 0.0];
        let found = host(rows.reshape([6])).expect("readable");
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}");
    }
}
