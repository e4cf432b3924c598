//! The backward pass: from the gradient of the last layer's output to those of all parameters and the input.

use super::forward::{Layer, MOST_LAYERS, ROWS, pieces, products, rows_product};
use super::packed::Packed;
use super::params::{LayerSums, ParamGrads, param_grads};
use super::sum_grads::{SumGrads, through_activation};
use crate::nn::cpu::share::share_each;

/// The requested gradients.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    /// False if the gradient of the input may stay empty, which saves a product.
    pub(super) x: bool,
    /// False if the gradients of the parameters may stay empty.
    pub(super) params: bool,
}

/// Returns the gradients of the input `[n, inputs]` and of each layer's parameters, for `grad`, the gradient of the
/// last layer's output.
///
/// `outputs` holds the outputs of all layers.
pub(super) fn backward(
    grad: &[f32],
    x: &[f32],
    layers: &[Layer<'_>],
    outputs: &[&[f32]],
    wanted: Wanted,
) -> (Vec<f32>, Vec<ParamGrads>) {
    let n = x.len() / layers[0].inputs();
    let mut sums: Vec<SumGrads> = layers.iter().map(|layer| SumGrads::unwritten(n, layer.outputs())).collect();
    let mut of_x = if wanted.x { vec![0.0; x.len()] } else { Vec::new() };
    to_sums(grad, layers, outputs, &mut sums, &mut of_x);
    if !wanted.params {
        return (of_x, Vec::new());
    }
    let given = std::iter::once(x).chain(outputs.iter().copied());
    let of_layers = given.zip(layers).zip(&sums);
    let of_layers = of_layers.map(|((x, layer), sums)| LayerSums { x, inputs: layer.inputs(), sums });
    (of_x, param_grads(&of_layers.collect::<Vec<_>>()))
}

/// Computes the gradients of all layers' sums, and that of the input unless it is empty.
fn to_sums(grad: &[f32], layers: &[Layer<'_>], outputs: &[&[f32]], sums: &mut [SumGrads], of_x: &mut [f32]) {
    // The layers whose inputs have gradients; the first one only on request.
    let first = usize::from(of_x.is_empty());
    let turned = Packed::all(&layers.iter().skip(first).map(Layer::turned).collect::<Vec<_>>());
    let strides: Vec<usize> = sums.iter().map(SumGrads::stride).collect();
    let last = layers.len() - 1;
    let (inputs, width) = (layers[0].inputs(), layers[last].outputs());
    let n = grad.len() / width;
    let numbers = sums.iter_mut().map(SumGrads::values_mut).zip(strides.iter().copied());
    let mut x_rows = of_x.chunks_mut(ROWS * inputs);
    let rows = pieces(numbers, n).into_iter().map(|sums| (sums, x_rows.next().unwrap_or_default()));
    let mut rows: Vec<([&mut [f32]; MOST_LAYERS], &mut [f32])> = rows.collect();
    share_each(&mut rows, n * products(layers), |piece, (sums, of_x)| {
        let given = grad[piece * ROWS * width..].chunks_exact(width);
        for (to, grad) in sums[last].chunks_exact_mut(strides[last]).zip(given) {
            to[..width].copy_from_slice(grad);
        }
        for (place, layer) in layers.iter().enumerate().rev() {
            let (before, here) = sums.split_at_mut(place);
            let (sums, columns) = (&mut *here[0], layer.outputs());
            through_activation(sums, &outputs[place][piece * ROWS * columns..], columns, layer.activation);
            match before.last_mut() {
                Some(before) => {
                    rows_product(before, strides[place - 1], sums, strides[place], &turned[place - first], &[]);
                }
                None if first == 0 => rows_product(of_x, inputs, sums, strides[0], &turned[0], &[]),
                None => {}
            }
        }
    });
}
