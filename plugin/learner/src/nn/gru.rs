//! A stack of gated recurrent layers, in one or both directions.

use crate::nn::params::{Init, ParamSource, ParamVisitor, Parameters, RandomInit, path};
use burn::tensor::{Device, Tensor, activation::sigmoid};
use playbot_kernels::{host_numbers::is_host, host_ops, host_ops::GruInput};
use rand::Rng;

/// One recurrent layer. The directions lie side by side in the first dimension.
#[derive(Clone, Debug)]
pub struct GruLayer {
    /// `[directions, inputs, 3 * hidden]`; the columns are the reset, update and new gates.
    pub weight_ih: Tensor<3>,
    /// `[directions, hidden, 3 * hidden]`.
    pub weight_hh: Tensor<3>,
    /// `[directions, 3 * hidden]`.
    pub bias_ih: Tensor<2>,
    /// `[directions, 3 * hidden]`.
    pub bias_hh: Tensor<2>,
}

/// Gated recurrent unit (Cho et al. 2014) in the common form where the reset gate multiplies the hidden product and
/// its bias:
///
/// r = σ(x W_ir + b_ir + h W_hr + b_hr), z = σ(x W_iz + b_iz + h W_hz + b_hz),
/// n = tanh(x W_in + b_in + r (h W_hn + b_hn)), h' = (1 - z) n + z h.
#[derive(Clone, Debug)]
pub struct Gru {
    /// The layers, from the input up.
    pub layers: Vec<GruLayer>,
}

impl Gru {
    /// Creates a stack with weights and biases uniform in ±1/√hidden.
    pub fn new<R: Rng + ?Sized>(
        inputs: usize,
        hidden: usize,
        layers: usize,
        bidirectional: bool,
        rng: &mut R,
        device: &Device,
    ) -> Self {
        let source = &mut RandomInit { rng, device };
        let Ok(gru) = Self::build(source, "", inputs, hidden, layers, bidirectional);
        gru
    }

    /// Creates a stack as [`Self::new`], with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        inputs: usize,
        hidden: usize,
        layers: usize,
        bidirectional: bool,
    ) -> Result<Self, S::Error> {
        let directions = if bidirectional { 2 } else { 1 };
        let init = Init::Uniform(1.0 / (hidden as f64).sqrt());
        let gates = hidden.saturating_mul(3);
        let layer = |k: usize| -> Result<GruLayer, S::Error> {
            let width = if k == 0 { inputs } else { hidden.saturating_mul(directions) };
            let prefix = path(prefix, &format!("l{k}"));
            Ok(GruLayer {
                weight_ih: source.param(&path(&prefix, "weight_ih"), [directions, width, gates], init)?,
                weight_hh: source.param(&path(&prefix, "weight_hh"), [directions, hidden, gates], init)?,
                bias_ih: source.param(&path(&prefix, "bias_ih"), [directions, gates], init)?,
                bias_hh: source.param(&path(&prefix, "bias_hh"), [directions, gates], init)?,
            })
        };
        Ok(Self { layers: (0..layers).map(layer).collect::<Result<_, S::Error>>()? })
    }

    /// Runs over a sequence `[steps * B, inputs]`, time-major (row `t * B + b`), from `initial` states (one
    /// `[directions, B, hidden]` per layer) or zeros.
    ///
    /// Returns the outputs of the last layer, `[steps * B, directions * hidden]` (forward features first), and the last
    /// state of each layer, `[directions, B, hidden]`. The backward direction ends at the first time step.
    pub fn forward(
        &self,
        sequence: Tensor<2>,
        steps: usize,
        initial: Option<Vec<Tensor<3>>>,
    ) -> (Tensor<2>, Vec<Tensor<3>>) {
        let mut initial = initial.unwrap_or_default().into_iter();
        let mut last = Vec::with_capacity(self.layers.len());
        let mut sequence = sequence;
        for layer in &self.layers {
            sequence = layer.outputs(sequence, steps, initial.next());
            last.push(layer.last_state(&sequence, steps));
        }
        (sequence, last)
    }

    /// Returns `[B, directions * hidden]`: the last layer's forward output at the last step joined with its backward
    /// output at the first step of the `sequence`, which is as in [`Self::forward`].
    pub fn summary(&self, sequence: Tensor<2>, steps: usize) -> Tensor<2> {
        let outputs = self.layers.iter().fold(sequence, |x, layer| layer.outputs(x, steps, None));
        match self.layers.last() {
            Some(layer) => join_directions(layer.last_state(&outputs, steps)),
            None => outputs,
        }
    }
}

impl GruLayer {
    /// Returns the state after each step of `x` `[steps * B, inputs]`: `[steps * B, directions * hidden]`. The second
    /// direction reads the sequence backwards.
    fn outputs(&self, x: Tensor<2>, steps: usize, initial: Option<Tensor<3>>) -> Tensor<2> {
        let [directions, hidden, _] = self.weight_hh.dims();
        let batch = x.dims()[0] / steps.max(1);
        let device = x.device();
        let initial = initial.unwrap_or_else(|| Tensor::zeros([directions, batch, hidden], &device));
        let scan = if is_host(&device) { host_ops::gru } else { gru_steps };
        scan(GruInput {
            x,
            weight_ih: self.weight_ih.clone(),
            weight_hh: self.weight_hh.clone(),
            bias_ih: self.bias_ih.clone(),
            bias_hh: self.bias_hh.clone(),
            initial,
        })
    }

    /// Returns the last state of each direction, `[directions, B, hidden]`, taken from the outputs.
    fn last_state(&self, outputs: &Tensor<2>, steps: usize) -> Tensor<3> {
        let [directions, hidden, _] = self.weight_hh.dims();
        let rows = outputs.dims()[0];
        let batch = rows / steps.max(1);
        let part = |d: usize| {
            let rows = if d == 0 { rows - batch..rows } else { 0..batch };
            outputs.clone().slice([rows, d * hidden..(d + 1) * hidden])
        };
        Tensor::stack((0..directions).map(part).collect(), 0)
    }
}

/// Applies a layer in tensor operations, for devices without a kernel and as a reference for the kernel: the same as
/// [`playbot_kernels::host_ops::gru`].
fn gru_steps(input: GruInput) -> Tensor<2> {
    let GruInput { x, weight_ih, weight_hh: weight, bias_ih, bias_hh, initial } = input;
    let [directions, batch, hidden] = initial.dims();
    let steps = x.dims()[0] / batch.max(1);
    let input = x.unsqueeze_dim(0).matmul(weight_ih) + bias_ih.unsqueeze_dim(1);
    let bias_hh: Tensor<3> = bias_hh.unsqueeze_dim(1);
    let parts = (0..directions).map(|d| {
        let one = |tensor: &Tensor<3>| -> Tensor<2> { tensor.clone().narrow(0, d, 1).squeeze_dim(0) };
        let (input, weight, bias, mut h) = (one(&input), one(&weight), one(&bias_hh), one(&initial));
        let mut states = Vec::with_capacity(steps);
        for s in 0..steps {
            let t = if d == 1 { steps - 1 - s } else { s };
            let a = input.clone().narrow(0, t * batch, batch);
            let c = h.clone().matmul(weight.clone()) + bias.clone();
            let gate = |all: &Tensor<2>, k: usize, count: usize| all.clone().narrow(1, k * hidden, count * hidden);
            let rz = sigmoid(gate(&a, 0, 2) + gate(&c, 0, 2));
            let n = (gate(&a, 2, 1) + gate(&rz, 0, 1) * gate(&c, 2, 1)).tanh();
            h = n.clone() + gate(&rz, 1, 1) * (h - n);
            states.push(h.clone());
        }
        if d == 1 {
            states.reverse();
        }
        Tensor::cat(states, 0)
    });
    Tensor::cat(parts.collect(), 1)
}

/// Maps `[directions, B, hidden]` to `[B, directions * hidden]`.
fn join_directions(state: Tensor<3>) -> Tensor<2> {
    let [directions, batch, hidden] = state.dims();
    state.swap_dims(0, 1).reshape([batch, directions * hidden])
}

impl Parameters for Gru {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        for (i, layer) in self.layers.iter_mut().enumerate() {
            let name = path(prefix, &format!("l{i}"));
            visitor.visit(&path(&name, "weight_ih"), &mut layer.weight_ih);
            visitor.visit(&path(&name, "weight_hh"), &mut layer.weight_hh);
            visitor.visit(&path(&name, "bias_ih"), &mut layer.bias_ih);
            visitor.visit(&path(&name, "bias_hh"), &mut layer.bias_hh);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::{NamedGrads, host, matrix, tracked};
    use crate::rng::{Streams, normal};
    use burn::tensor::TensorData;

    const STEPS: usize = 4;
    const BATCH: usize = 3;

    /// Returns the outputs under `scan` and the gradients of all its inputs, for a loss in which each output has its
    /// own weight.
    fn run(
        scan: fn(GruInput) -> Tensor<2>,
        directions: usize,
        hidden: usize,
        kind: DeviceKind,
    ) -> Vec<(&'static str, Vec<f32>)> {
        let device = kind.plain();
        let mut rng = Streams::new(1).stream("gru kernel", 0);
        const INPUTS: usize = 7;
        let mut layer = Gru::new(INPUTS, hidden, 1, directions == 2, &mut rng, &device);
        let mut numbers = |n: usize| (0..n).map(|_| 2.0 * normal(&mut rng)).collect::<Vec<f32>>();
        let mut cube = |rows: usize, width: usize| -> Tensor<3> {
            Tensor::from_data(TensorData::new(numbers(directions * rows * width), [directions, rows, width]), &device)
        };
        let initial = cube(BATCH, hidden).autodiff().require_grad();
        let x = matrix(numbers(STEPS * BATCH * INPUTS), STEPS * BATCH, INPUTS, &device).autodiff().require_grad();
        let probe = matrix(numbers(STEPS * BATCH * directions * hidden), STEPS * BATCH, directions * hidden, &device);
        layer = tracked(&layer);
        let GruLayer { weight_ih, weight_hh, bias_ih, bias_hh } = layer.layers[0].clone();
        let of_scan = GruInput { x: x.clone(), weight_ih, weight_hh, bias_ih, bias_hh, initial: initial.clone() };
        let output = scan(of_scan);
        let grads = (output.clone() * probe).sum().backward();
        let named = NamedGrads::read(&mut layer, "", &grads).expect("readable");
        let mut found = vec![
            ("output", host(output.inner()).expect("readable")),
            ("x", host(x.grad(&grads).expect("tracked")).expect("readable")),
            ("initial", host(initial.grad(&grads).expect("tracked")).expect("readable")),
        ];
        for name in ["l0.weight_ih", "l0.weight_hh", "l0.bias_ih", "l0.bias_hh"] {
            found.push((name, named.get(name).expect("a parameter").to_vec()));
        }
        found
    }

    #[test]
    fn the_kernel_agrees_with_tensor_operations() {
        for kind in DeviceKind::CPU {
            for (directions, hidden) in [(1, 5), (2, 5), (2, 16)] {
                let want = run(gru_steps, directions, hidden, kind);
                let got = run(host_ops::gru, directions, hidden, kind);
                for ((name, want), (_, got)) in want.iter().zip(&got) {
                    assert_eq!(want.len(), got.len());
                    assert!(want.iter().any(|x| x.abs() > 0.1), "{name} is a test");
                    for (x, y) in want.iter().zip(got) {
                        assert!((x - y).abs() <= 5e-6 * (1.0 + x.abs()), "{name} on {kind}: {y} is not {x}");
                    }
                }
            }
        }
    }
}
