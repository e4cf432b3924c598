//! The Adam optimizer over named parameters.

use crate::{
    LearnError,
    device::{read, send},
    nn::{
        grads::NamedGrads,
        params::{ParamVisitor, Parameters, host, vector},
    },
};
use burn::tensor::{Device, Gradients, Tensor, TensorData};
use playbot_kernels::{
    instructions::macerator::{self, Simd},
    kept_memory::share_each,
};
use serde::{Deserialize, Serialize};
use std::{
    borrow::Cow,
    collections::BTreeMap,
    iter::Peekable,
    ops::Add,
    time::{Duration, Instant},
};

/// Numbers that one thread updates at a time.
const CHUNK: usize = 1 << 13;

/// Number of products that take as long as the update of a number, which waits for memory.
const OF_A_NUMBER: usize = 16;

/// Numbers that are updated side by side.
const LANES: usize = 16;

/// Constants of Adam (Kingma and Ba 2014).
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub struct AdamConfig {
    /// Decay of the first moment.
    pub beta1: f64,
    /// Decay of the second moment.
    pub beta2: f64,
    /// Added to the root of the second moment.
    pub eps: f64,
    /// Decoupled weight decay (AdamW): p -= lr · weight_decay · p before the step. 0 is Adam.
    pub weight_decay: f64,
}

impl Default for AdamConfig {
    fn default() -> Self {
        Self { beta1: 0.9, beta2: 0.999, eps: 1e-5, weight_decay: 0.0 }
    }
}

/// Adam with one step counter for all parameters.
///
/// The moments live on the host, by parameter name, so that a checkpoint holds the whole state. For a network on a
/// graphics card they live there, and are read when a checkpoint is written.
#[derive(Clone, Debug)]
pub struct Adam {
    pub(crate) config: AdamConfig,
    pub(crate) steps: u64,
    pub(crate) moments: BTreeMap<String, Moments>,
    /// The moments, in place of those above, if they are on a graphics card.
    pub(super) flat: Option<FlatMoments>,
    /// Time spent on steps. It is not saved.
    spent: Duration,
}

impl Adam {
    /// Creates an optimizer without any state.
    pub fn new(config: AdamConfig) -> Self {
        Self { config, steps: 0, moments: BTreeMap::new(), flat: None, spent: Duration::ZERO }
    }

    /// Returns the number of steps done.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Returns the time spent on steps since it was made.
    pub fn spent(&self) -> Duration {
        self.spent
    }

    /// Returns the first and second moment of the parameter called `name`, if it was ever updated.
    pub fn moments(&self, name: &str) -> Option<(&[f32], &[f32])> {
        self.moments.get(name).map(|moments| (moments.m.as_slice(), moments.v.as_slice()))
    }

    /// Returns first and second moments of each parameter by name, in host memory.
    ///
    /// # Errors
    /// [`LearnError::Device`] if they cannot be read from a graphics card.
    pub(crate) fn host_moments(&self) -> Result<Cow<'_, BTreeMap<String, Moments>>, LearnError> {
        match &self.flat {
            Some(flat) => Ok(Cow::Owned(flat.by_name()?)),
            None => Ok(Cow::Borrowed(&self.moments)),
        }
    }

    /// Restores the moments of a parameter from a checkpoint.
    pub(crate) fn restore(&mut self, name: String, shape: Vec<usize>, m: Vec<f32>, v: Vec<f32>) {
        self.moments.insert(name, Moments { shape, m, v });
    }

    /// Does one step with learning rate `lr` and all gradients times `scale` (see [`NamedGrads::clip_factor`]).
    ///
    /// The parameters stay tracked. Parameters without an entry in `grads` are unchanged.
    ///
    /// # Errors
    /// [`LearnError::NotFinite`] names the first weight that stopped being finite; [`LearnError::Config`] names the
    /// first gradient that belongs to no parameter, or comes in another order than the parameters;
    /// [`LearnError::Device`].
    pub fn step<M: Parameters>(
        &mut self,
        network: &mut M,
        prefix: &str,
        grads: &NamedGrads,
        lr: f64,
        scale: f64,
    ) -> Result<(), LearnError> {
        let start = Instant::now();
        self.steps += 1;
        let t = self.steps.min(i32::MAX as u64) as i32;
        let mut visitor = Step {
            formula: Formula::new(&self.config, lr, scale, t),
            steps: self.steps,
            moments: &mut self.moments,
            grads: grads.iter().peekable(),
            error: None,
        };
        network.visit(prefix, &mut visitor);
        if let Some(error) = visitor.error {
            return Err(error);
        }
        let superfluous = visitor.grads.next();
        self.spent += start.elapsed();
        match superfluous {
            None => Ok(()),
            Some((name, _)) => {
                Err(LearnError::Config(format!("the gradient of `{name}` belongs to no parameter here")))
            }
        }
    }
}

struct Step<'a, I: Iterator> {
    formula: Formula,
    steps: u64,
    moments: &'a mut BTreeMap<String, Moments>,
    grads: Peekable<I>,
    error: Option<LearnError>,
}

impl<'a, I: Iterator<Item = (&'a str, &'a [f32])>> ParamVisitor for Step<'a, I> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        if self.error.is_some() {
            return;
        }
        // Both come in the order of the network, so the next gradient is this one's or that of a later parameter.
        let Some((_, grad)) = self.grads.next_if(|(of, _)| *of == name) else { return };
        // Taken out of the network, so that its numbers are changed in place unless they are shared.
        let device = tensor.device().inner();
        let plain = std::mem::replace(tensor, Tensor::empty([0; D], &device)).inner();
        match read::<f32, _, _>(plain) {
            Ok(mut weights) => {
                self.error = self.update(name, &mut weights, grad).err();
                *tensor = send(weights, &device).autodiff().require_grad();
            }
            Err(error) => self.error = Some(error),
        }
    }
}

impl<I: Iterator> Step<'_, I> {
    fn update(&mut self, name: &str, weights: &mut TensorData, grad: &[f32]) -> Result<(), LearnError> {
        let shape = weights.shape().to_vec();
        let weights = weights.as_mut_slice::<f32>().map_err(|e| LearnError::Device(e.to_string()))?;
        LearnError::check(name, weights.len(), grad.len())?;
        if !self.moments.contains_key(name) {
            let zeros = vec![0.0; weights.len()];
            let fresh = Moments { shape, m: zeros.clone(), v: zeros };
            self.moments.insert(name.to_owned(), fresh);
        }
        let moments = self.moments.get_mut(name).expect("inserted above if it was missing");
        let (formula, products) = (&self.formula, weights.len() * OF_A_NUMBER);
        let rows = weights.chunks_mut(CHUNK).zip(grad.chunks(CHUNK));
        let moments = moments.m.chunks_mut(CHUNK).zip(moments.v.chunks_mut(CHUNK));
        let mut pieces: Vec<_> = rows.zip(moments).map(|(rows, moments)| (rows, moments, true)).collect();
        share_each(&mut pieces, products, |_, ((w, g), (m, v), is_finite)| *is_finite = formula.apply(w, g, m, v));
        let is_finite = pieces.iter().all(|(_, _, is_finite)| *is_finite);
        is_finite
            .then_some(())
            .ok_or_else(|| LearnError::NotFinite { tensor: name.to_owned(), steps: Some(self.steps) })
    }
}

/// The constants of one step.
struct Formula {
    beta: (f32, f32),
    /// 1 - β of each moment.
    gain: (f32, f32),
    eps: f32,
    /// Factor of the gradient.
    scale: f32,
    /// Factor of a weight after its decay.
    decay: f32,
    /// The learning rate with the first moment's bias correction.
    rate: f32,
    /// The second moment's bias correction.
    correction: f32,
}

impl Formula {
    fn new(config: &AdamConfig, lr: f64, scale: f64, t: i32) -> Self {
        let correction1 = (1.0 / (1.0 - config.beta1.powi(t))) as f32;
        Self {
            beta: (config.beta1 as f32, config.beta2 as f32),
            gain: ((1.0 - config.beta1) as f32, (1.0 - config.beta2) as f32),
            eps: config.eps as f32,
            scale: scale as f32,
            decay: (1.0 - lr * config.weight_decay) as f32,
            rate: lr as f32 * correction1,
            correction: (1.0 / (1.0 - config.beta2.powi(t))) as f32,
        }
    }

    /// Updates weights and moments, and returns whether all weights are finite.
    fn apply(&self, weights: &mut [f32], grad: &[f32], m: &mut [f32], v: &mut [f32]) -> bool {
        // 0 for finite numbers, NaN otherwise.
        let mut witness = [0.0f32; LANES];
        update(self, weights, grad, m, v, &mut witness);
        witness.iter().sum::<f32>() == 0.0
    }

    /// Updates one weight and its moments, and returns 0 if it is finite.
    #[inline(always)]
    fn apply_to(&self, w: &mut f32, g: f32, m: &mut f32, v: &mut f32) -> f32 {
        let Self { beta, gain, eps, scale, decay, rate, correction } = *self;
        let g = g * scale;
        *m = beta.0 * *m + gain.0 * g;
        *v = beta.1 * *v + gain.1 * g * g;
        *w = *w * decay - rate * *m / ((*v * correction).sqrt() + eps);
        *w * 0.0
    }
}

#[macerator::with_simd]
#[allow(clippy::extra_unused_type_parameters, reason = "S says which instructions the loop is compiled for")]
fn update<S: Simd>(
    formula: &Formula,
    weights: &mut [f32],
    grad: &[f32],
    m: &mut [f32],
    v: &mut [f32],
    witness: &mut [f32; LANES],
) {
    {
        let (weights, w_rest) = weights.as_chunks_mut::<LANES>();
        let (grad, g_rest) = grad.as_chunks::<LANES>();
        let (m, m_rest) = m.as_chunks_mut::<LANES>();
        let (v, v_rest) = v.as_chunks_mut::<LANES>();
        for ((w, g), (m, v)) in weights.iter_mut().zip(grad).zip(m.iter_mut().zip(v)) {
            for lane in 0..LANES {
                witness[lane] += formula.apply_to(&mut w[lane], g[lane], &mut m[lane], &mut v[lane]);
            }
        }
        for ((w, &g), (m, v)) in w_rest.iter_mut().zip(g_rest).zip(m_rest.iter_mut().zip(v_rest)) {
            witness[0] += formula.apply_to(w, g, m, v);
        }
    }
}

// Adam on the device of the parameters: on a graphics card, without reading anything back.

/// The gradient of a network on its device: all numbers one after the other.
pub(crate) struct FlatGrads {
    numbers: Tensor<1>,
    /// Names and dimensions of the parameters.
    layout: Vec<(String, Vec<usize>)>,
}

impl FlatGrads {
    /// Takes the gradient of every parameter of `network` away from `grads`; zeros if the loss does not depend on it.
    pub(crate) fn take<M: Parameters>(network: &mut M, mut grads: Gradients) -> Self {
        let mut read = Flatten { grads: &mut grads, parts: Vec::new(), layout: Vec::new() };
        network.visit("", &mut read);
        Self { numbers: Tensor::cat(read.parts, 0), layout: read.layout }
    }
}

impl Add for FlatGrads {
    type Output = Self;

    /// Adds the gradients of the same network for other rows.
    fn add(self, more: Self) -> Self {
        Self { numbers: self.numbers + more.numbers, layout: self.layout }
    }
}

impl Adam {
    /// Does [`Adam::step`] after clipping by the global norm, which is returned, `[1]`. The moments stay on the
    /// network's device.
    ///
    /// If a gradient is not finite, the returned norm is not finite, and the weights are lost.
    pub(crate) fn step_on_device<M: Parameters>(
        &mut self,
        network: &mut M,
        grads: FlatGrads,
        lr: f64,
        max_norm: f64,
    ) -> Tensor<1> {
        let start = Instant::now();
        let FlatGrads { numbers: grad, layout } = grads;
        let FlatMoments { m, v, .. } = match self.flat.take() {
            Some(moments) => moments,
            None => FlatMoments::send(&self.moments, layout.clone(), &grad.device()),
        };
        self.steps += 1;
        let t = self.steps.min(i32::MAX as u64) as i32;
        let (b1, b2) = (self.config.beta1, self.config.beta2);
        let norm = grad.clone().square().sum().sqrt();
        let scale = ((norm.clone() + 1e-6).recip() * max_norm).clamp_max(1.0);
        let grad = grad * scale;
        let m = m * b1 + grad.clone() * (1.0 - b1);
        let v = v * b2 + grad.square() * (1.0 - b2);
        let root = (v.clone() / (1.0 - b2.powi(t))).sqrt() + self.config.eps;
        let change = m.clone() * (lr / (1.0 - b1.powi(t))) / root;
        let decay = 1.0 - lr * self.config.weight_decay;
        network.visit("", &mut Apply { change, at: 0, decay });
        self.flat = Some(FlatMoments { m, v, layout });
        self.spent += start.elapsed();
        norm
    }
}

struct Flatten<'a> {
    grads: &'a mut Gradients,
    parts: Vec<Tensor<1>>,
    layout: Vec<(String, Vec<usize>)>,
}

impl ParamVisitor for Flatten<'_> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        let dims = tensor.dims();
        let size = dims.iter().product::<usize>();
        self.layout.push((name.to_owned(), dims.to_vec()));
        self.parts.push(match tensor.grad_remove(self.grads) {
            Some(grad) => grad.reshape([size]),
            None => Tensor::zeros([size], &tensor.device().inner()),
        });
    }
}

struct Apply {
    change: Tensor<1>,
    at: usize,
    decay: f64,
}

impl ParamVisitor for Apply {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        let dims = tensor.dims();
        let size = dims.iter().product::<usize>();
        let change = self.change.clone().narrow(0, self.at, size).reshape(dims);
        self.at += size;
        *tensor = (tensor.clone().inner() * self.decay - change).autodiff().require_grad();
    }
}

// The moments of Adam, in host memory or on a graphics card.

/// First and second moment of one parameter, without bias correction.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moments {
    pub(crate) shape: Vec<usize>,
    pub(crate) m: Vec<f32>,
    pub(crate) v: Vec<f32>,
}

/// Moments of all parameters, one after the other in the order of the network.
#[derive(Clone, Debug)]
pub(super) struct FlatMoments {
    pub(super) m: Tensor<1>,
    pub(super) v: Tensor<1>,
    pub(super) layout: Vec<(String, Vec<usize>)>,
}

impl FlatMoments {
    /// Copies `moments` to `device`; zeros for parameters that have none.
    pub(super) fn send(
        moments: &BTreeMap<String, Moments>,
        layout: Vec<(String, Vec<usize>)>,
        device: &Device,
    ) -> Self {
        let (mut m, mut v) = (Vec::new(), Vec::new());
        for (name, shape) in &layout {
            match moments.get(name) {
                Some(moments) => {
                    m.extend_from_slice(&moments.m);
                    v.extend_from_slice(&moments.v);
                }
                None => {
                    let end = m.len() + shape.iter().product::<usize>();
                    m.resize(end, 0.0);
                    v.resize(end, 0.0);
                }
            }
        }
        Self { m: vector(m, device), v: vector(v, device), layout }
    }

    /// Returns the moments in host memory, by the names of the parameters.
    ///
    /// # Errors
    /// [`LearnError::Device`] if they cannot be read.
    pub(super) fn by_name(&self) -> Result<BTreeMap<String, Moments>, LearnError> {
        let (m, v) = (host(self.m.clone())?, host(self.v.clone())?);
        let (mut m, mut v) = (m.as_slice(), v.as_slice());
        let mut found = BTreeMap::new();
        for (name, shape) in &self.layout {
            let size = shape.iter().product();
            let ((own_m, rest_m), (own_v, rest_v)) = (m.split_at(size), v.split_at(size));
            (m, v) = (rest_m, rest_v);
            found.insert(name.clone(), Moments { shape: shape.clone(), m: own_m.to_vec(), v: own_v.to_vec() });
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use playbot_kernels::elementwise::Activation;

    use super::*;
    use crate::{
        DeviceKind,
        nn::{Mlp, NamedGrads, host, matrix, path, tracked, vector},
        rng::{Streams, normal},
    };

    /// Two numbers, of which the loss may depend on one.
    #[derive(Clone)]
    struct Pair(Tensor<1>, Tensor<1>);

    impl Parameters for Pair {
        fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
            visitor.visit(&path(prefix, "a"), &mut self.0);
            visitor.visit(&path(prefix, "b"), &mut self.1);
        }
    }

    /// The second number of a pair alone.
    #[derive(Clone)]
    struct Second(Tensor<1>);

    impl Parameters for Second {
        fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
            visitor.visit(&path(prefix, "b"), &mut self.0);
        }
    }

    #[test]
    fn gradients_go_by_name() {
        let device = DeviceKind::Flex.plain();
        let number = || vector(vec![1.0], &device);
        let mut second = tracked(&Second(number()));
        let loss = (second.0.clone() * 3.0).sum();
        let grads = NamedGrads::read(&mut second, "", &loss.backward()).expect("readable");
        let mut pair = tracked(&Pair(number(), number()));
        let mut adam = Adam::new(AdamConfig::default());
        adam.step(&mut pair, "", &grads, 0.1, 1.0).expect("`b` is there");
        let numbers = |tensor: &Tensor<1>| crate::nn::host(tensor.clone().inner()).expect("readable")[0];
        assert_eq!(numbers(&pair.0), 1.0);
        assert!((numbers(&pair.1) - 0.9).abs() < 1e-3);
        let error = adam.step(&mut pair, "other", &grads, 0.1, 1.0).expect_err("no `other.b`").to_string();
        assert!(error.contains("`b`"), "{error}");
    }

    #[test]
    fn it_goes_where_the_other_goes_and_leaves_the_same_moments() {
        for kind in DeviceKind::BUILT.iter().filter(|kind| kind.check().is_ok()) {
            let device = kind.plain();
            let mut rng = Streams::new(3).stream("adam", 0);
            let mut one = tracked(&Mlp::new(5, &[7], 3, Activation::Tanh, 1.0, &mut rng, &device));
            let mut other = one.clone();
            let x = matrix((0..20).map(|_| normal(&mut rng)).collect(), 4, 5, &device);
            let (mut host_adam, mut adam) = (Adam::new(AdamConfig::default()), Adam::new(AdamConfig::default()));
            for _ in 0..5 {
                let loss = |net: &Mlp| net.forward(x.clone()).square().sum();
                let (grads, others) = (loss(&one).backward(), loss(&other).backward());
                let grads = NamedGrads::take(&mut one, "", grads).expect("readable");
                let (norm, scale) = grads.clip_factor(0.5, 0).expect("finite");
                host_adam.step(&mut one, "", &grads, 1e-2, scale).expect("fits");
                let others = FlatGrads::take(&mut other, others);
                let found = adam.step_on_device(&mut other, others, 1e-2, 0.5);
                let found = f64::from(host(found).expect("readable")[0]);
                assert!((found - norm).abs() < 1e-4 * norm, "{kind}: {found} for {norm}");
            }
            let moments = adam.host_moments().expect("readable");
            for (name, want) in host_adam.host_moments().expect("there").iter() {
                let found = &moments[name];
                assert_eq!(found.shape, want.shape);
                for (found, want) in found.m.iter().chain(&found.v).zip(want.m.iter().chain(&want.v)) {
                    assert!((found - want).abs() < 1e-5, "{kind} {name}: {found} for {want}");
                }
            }
            let (one, other) = (one.forward(x.clone()), other.forward(x));
            let far = host((one - other).inner().abs().max()).expect("readable")[0];
            assert!(far < 1e-4, "{kind}: outputs differ by {far}");
        }
    }
}
