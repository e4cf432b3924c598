//! A stack of gated recurrent layers, in one or both directions.

use super::params::{ParamVisitor, Parameters, path};
use super::{init::uniform, tensors};
use burn::tensor::{Device, Tensor, TensorData, activation::sigmoid};
use rand::Rng;

/// One recurrent layer. The directions lie side by side in the first dimension and are computed together.
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
    /// Weights and biases uniform in ±1/√hidden.
    pub fn new<R: Rng + ?Sized>(
        inputs: usize,
        hidden: usize,
        layers: usize,
        bidirectional: bool,
        rng: &mut R,
        device: &Device,
    ) -> Self {
        let directions = if bidirectional { 2 } else { 1 };
        let bound = 1.0 / (hidden as f64).sqrt();
        let gates = 3 * hidden;
        let layers = (0..layers)
            .map(|k| {
                let width = if k == 0 { inputs } else { directions * hidden };
                let mut cube = |rows: usize| {
                    let values = uniform(directions * rows * gates, bound, rng);
                    Tensor::from_data(TensorData::new(values, [directions, rows, gates]), device)
                };
                let (weight_ih, weight_hh) = (cube(width), cube(hidden));
                let mut bias = || {
                    let values = uniform(directions * gates, bound, rng);
                    tensors::matrix(values, directions, gates, device)
                };
                GruLayer { weight_ih, weight_hh, bias_ih: bias(), bias_hh: bias() }
            })
            .collect();
        Self { layers }
    }

    /// Runs over a sequence, one `[B, inputs]` tensor per time step, from `initial` states (one `[directions, B,
    /// hidden]` per layer) or zeros.
    ///
    /// Gives the outputs of the last layer per time step, `[B, directions * hidden]` (forward features first), and
    /// the last state of each layer, `[directions, B, hidden]`; the backward direction ends at the first time step.
    pub fn forward(
        &self,
        sequence: Vec<Tensor<2>>,
        initial: Option<Vec<Tensor<3>>>,
    ) -> (Vec<Tensor<2>>, Vec<Tensor<3>>) {
        let mut initial = initial.unwrap_or_default().into_iter();
        let mut last = Vec::with_capacity(self.layers.len());
        let mut sequence = sequence;
        for layer in &self.layers {
            let states = layer.states(&sequence, initial.next());
            last.extend(states.last().cloned());
            sequence = layer.outputs(&states);
        }
        (sequence, last)
    }

    /// `[B, directions * hidden]`: the last layer's forward output at the last step joined with its backward output
    /// at the first step. `sequence` must not be empty.
    pub fn summary(&self, sequence: Vec<Tensor<2>>) -> Tensor<2> {
        let mut sequence = sequence;
        let mut states = Vec::new();
        for (k, layer) in self.layers.iter().enumerate() {
            if k > 0 {
                sequence = layer.outputs(&states);
            }
            states = layer.states(&sequence, None);
        }
        let last = states.pop().expect("a sequence has at least one step and a stack one layer");
        join_directions(last)
    }
}

impl GruLayer {
    /// The state after each step, `[directions, B, hidden]`; the second direction reads the sequence backwards.
    fn states(&self, sequence: &[Tensor<2>], initial: Option<Tensor<3>>) -> Vec<Tensor<3>> {
        let [directions, hidden, gates] = self.weight_hh.dims();
        let bias_ih = self.bias_ih.clone().reshape([directions, 1, gates]);
        let bias_hh = self.bias_hh.clone().reshape([directions, 1, gates]);
        let steps = sequence.len();
        let mut state = initial;
        let mut states = Vec::with_capacity(steps);
        for t in 0..steps {
            let x: Tensor<3> = if directions == 2 {
                Tensor::stack(vec![sequence[t].clone(), sequence[steps - 1 - t].clone()], 0)
            } else {
                sequence[t].clone().unsqueeze_dim(0)
            };
            let [_, batch, _] = x.dims();
            let input = x.matmul(self.weight_ih.clone()) + bias_ih.clone();
            let gate = |all: &Tensor<3>, from: usize, to: usize| {
                all.clone().slice([0..directions, 0..batch, from * hidden..to * hidden])
            };
            let next = match state.take() {
                Some(h) => {
                    let recurrent = h.clone().matmul(self.weight_hh.clone()) + bias_hh.clone();
                    let rz = sigmoid(gate(&input, 0, 2) + gate(&recurrent, 0, 2));
                    let (r, z) = (gate(&rz, 0, 1), gate(&rz, 1, 2));
                    let n = (gate(&input, 2, 3) + r * gate(&recurrent, 2, 3)).tanh();
                    n.clone() + z * (h - n)
                }
                // From the zero state the recurrent product is its bias.
                None => {
                    let rz = sigmoid(gate(&input, 0, 2) + bias_hh.clone().slice([0..directions, 0..1, 0..2 * hidden]));
                    let (r, z) = (gate(&rz, 0, 1), gate(&rz, 1, 2));
                    let bias_n = bias_hh.clone().slice([0..directions, 0..1, 2 * hidden..gates]);
                    let n = (gate(&input, 2, 3) + r * bias_n).tanh();
                    n.clone() - z * n
                }
            };
            states.push(next.clone());
            state = Some(next);
        }
        states
    }

    /// The states as outputs per time step, `[B, directions * hidden]`.
    fn outputs(&self, states: &[Tensor<3>]) -> Vec<Tensor<2>> {
        let [directions, hidden, _] = self.weight_hh.dims();
        if directions == 1 {
            return states.iter().map(|h| h.clone().squeeze_dim(0)).collect();
        }
        let part = |h: &Tensor<3>, d: usize| -> Tensor<2> {
            let [_, batch, _] = h.dims();
            h.clone().slice([d..d + 1, 0..batch, 0..hidden]).squeeze_dim(0)
        };
        (0..states.len())
            .map(|t| {
                let backward = part(&states[states.len() - 1 - t], 1);
                Tensor::cat(vec![part(&states[t], 0), backward], 1)
            })
            .collect()
    }
}

/// `[directions, B, hidden]` to `[B, directions * hidden]`.
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
