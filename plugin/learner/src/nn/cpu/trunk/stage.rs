//! The stages of a trunk, and its forward pass on tensors.

use super::op;
use super::plan::{Plan, StageShape};
use super::shape::ConvShape;
use burn::tensor::Tensor;
use std::sync::Arc;

/// Parameters of a convolution with a square kernel.
#[derive(Clone, Copy, Debug)]
pub(in crate::nn) struct Conv<'a> {
    /// `[outputs, inputs, kernel, kernel]`.
    pub weight: &'a Tensor<4>,
    /// `[outputs]`.
    pub bias: &'a Tensor<1>,
    /// Pixels from one position of the kernel to the next.
    pub stride: usize,
    /// Zeros around the image.
    pub padding: usize,
}

/// One stage of a trunk.
#[derive(Clone, Copy, Debug)]
pub(in crate::nn) enum Stage<'a> {
    /// A convolution, then ReLU.
    Relu(Conv<'a>),
    /// A convolution, then max-pooling of 3×3 at every second pixel with padding 1.
    Pool(Conv<'a>),
    /// x + conv1(relu(conv0(relu(x)))).
    Residual(Conv<'a>, Conv<'a>),
}

/// Applies the stages and a last ReLU to images `[n, channels, height, width]`: features `[n, channels' * height' *
/// width']`. Returns `None` if this is not on flex, or for unsupported stages: every convolution must keep the size
/// of its image or have no padding.
///
/// Gradients reach the convolutions' parameters, never the pixels.
pub(in crate::nn) fn forward(pixels: &Tensor<4>, stages: &[Stage<'_>]) -> Option<Tensor<2>> {
    let [n, channels, height, width] = pixels.dims();
    if n == 0 || !op::is_flex(&pixels.device()) {
        return None;
    }
    let shapes: Vec<StageShape> = stages.iter().map(Stage::shape).collect();
    let plan = Plan::new(&shapes, [channels, height, width])?;
    let flat = |conv: Conv<'_>| -> [Tensor<1>; 2] { [conv.weight.clone().flatten(0, 3), conv.bias.clone()] };
    let params = stages.iter().flat_map(Stage::convs).flat_map(flat).collect();
    Some(op::trunk(pixels.clone(), Tensor::cat(params, 0), Arc::new(plan)))
}

impl<'a> Stage<'a> {
    fn convs(&self) -> impl Iterator<Item = Conv<'a>> + use<'a> {
        let (first, second) = match *self {
            Self::Relu(conv) | Self::Pool(conv) => (conv, None),
            Self::Residual(conv0, conv1) => (conv0, Some(conv1)),
        };
        std::iter::once(first).chain(second)
    }

    fn shape(&self) -> StageShape {
        match self {
            Self::Relu(conv) => StageShape::Relu(shape(*conv)),
            Self::Pool(conv) => StageShape::Pool(shape(*conv)),
            Self::Residual(conv0, conv1) => StageShape::Residual([shape(*conv0), shape(*conv1)]),
        }
    }
}

fn shape(conv: Conv<'_>) -> ConvShape {
    let [outputs, inputs, kernel, _] = conv.weight.dims();
    ConvShape { inputs, outputs, kernel, stride: conv.stride, padding: conv.padding }
}
