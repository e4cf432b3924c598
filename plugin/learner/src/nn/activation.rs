//! The non-linearity between layers.

use super::cpu::kernels;
use crate::device::is_host;
use burn::tensor::{Tensor, activation};
use serde::{Deserialize, Serialize};

/// An element-wise activation function.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Activation {
    /// max(x, 0).
    #[default]
    Relu,
    /// Hyperbolic tangent.
    Tanh,
}

impl Activation {
    /// Applies the function to every element.
    pub fn forward<const D: usize>(self, x: Tensor<D>) -> Tensor<D> {
        match self {
            Self::Relu => activation::relu(x),
            Self::Tanh if is_host(&x.device()) => kernels::tanh(x),
            Self::Tanh => x.tanh(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::{host, vector};

    #[test]
    fn tanh_and_its_gradient_agree_with_tensor_operations() {
        let x: Vec<f32> = (-400..=400).map(|i| i as f32 / 40.0).collect();
        for kind in DeviceKind::CPU {
            let both = |function: fn(Tensor<1>) -> Tensor<1>| {
                let x = vector(x.clone(), &kind.plain()).autodiff().require_grad();
                let y = function(x.clone());
                // Twice, so that gradients of two uses are added up.
                let grads = (y.clone() * 2.0 + y.clone().square()).sum().backward();
                [y.inner(), x.grad(&grads).expect("tracked")].map(|tensor| host(tensor).expect("readable"))
            };
            let want = both(|x| x.tanh());
            let got = both(|x| Activation::Tanh.forward(x));
            for (want, got) in want.iter().flatten().zip(got.iter().flatten()) {
                assert!((want - got).abs() <= 1e-6, "{got} is not {want} on {kind}");
            }
            let nan = host(Activation::Tanh.forward(vector(vec![f32::NAN], &kind.plain()))).expect("readable");
            assert!(nan[0].is_nan());
        }
    }
}
