//! The Adam optimizer over named parameters.

use super::grads::NamedGrads;
use super::params::{ParamVisitor, Parameters};
use super::tensors::host;
use crate::LearnError;
use burn::tensor::{Tensor, TensorData};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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

/// First and second moment of one parameter, without bias correction.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moments {
    pub(crate) shape: Vec<usize>,
    pub(crate) m: Vec<f32>,
    pub(crate) v: Vec<f32>,
}

/// Adam with one step counter for all parameters.
///
/// The moments live on the host, by parameter name, so that a checkpoint holds all of the state.
#[derive(Clone, Debug)]
pub struct Adam {
    pub(crate) config: AdamConfig,
    pub(crate) steps: u64,
    pub(crate) moments: BTreeMap<String, Moments>,
}

impl Adam {
    /// An optimizer that has seen nothing.
    pub fn new(config: AdamConfig) -> Self {
        Self { config, steps: 0, moments: BTreeMap::new() }
    }

    /// Steps done.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// First and second moment of the parameter called `name`, if it was ever updated.
    pub fn moments(&self, name: &str) -> Option<(&[f32], &[f32])> {
        self.moments.get(name).map(|moments| (moments.m.as_slice(), moments.v.as_slice()))
    }

    /// Puts back the moments of a parameter from a checkpoint.
    pub(crate) fn restore(&mut self, name: String, shape: Vec<usize>, m: Vec<f32>, v: Vec<f32>) {
        self.moments.insert(name, Moments { shape, m, v });
    }

    /// One step with learning rate `lr` and all gradients times `scale` (see [`NamedGrads::clip_factor`]).
    ///
    /// The parameters stay tracked. Parameters without an entry in `grads` stay as they are.
    ///
    /// # Errors
    /// [`LearnError::NotFinite`] names the first weight that stopped being finite; [`LearnError::Device`].
    pub fn step<M: Parameters>(
        &mut self,
        network: &mut M,
        prefix: &str,
        grads: &NamedGrads,
        lr: f64,
        scale: f64,
    ) -> Result<(), LearnError> {
        self.steps += 1;
        let t = self.steps.min(i32::MAX as u64) as i32;
        let mut visitor = Step {
            lr: lr as f32,
            decay: (1.0 - lr * self.config.weight_decay) as f32,
            scale: scale as f32,
            correction1: (1.0 / (1.0 - self.config.beta1.powi(t))) as f32,
            correction2: (1.0 / (1.0 - self.config.beta2.powi(t))) as f32,
            config: self.config,
            steps: self.steps,
            moments: &mut self.moments,
            grads: grads.iter(),
            error: None,
        };
        network.visit(prefix, &mut visitor);
        visitor.error.map_or(Ok(()), Err)
    }
}

struct Step<'a, I> {
    lr: f32,
    decay: f32,
    scale: f32,
    correction1: f32,
    correction2: f32,
    config: AdamConfig,
    steps: u64,
    moments: &'a mut BTreeMap<String, Moments>,
    grads: I,
    error: Option<LearnError>,
}

impl<'a, I: Iterator<Item = (&'a str, &'a [f32])>> ParamVisitor for Step<'a, I> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        if self.error.is_some() {
            return;
        }
        // `grads` were read from the same network, so that both come in the same order.
        let Some((grad_name, grad)) = self.grads.next() else { return };
        debug_assert_eq!(name, grad_name);
        match self.update(name, tensor, grad) {
            Ok(updated) => *tensor = updated,
            Err(error) => self.error = Some(error),
        }
    }
}

impl<I> Step<'_, I> {
    fn update<const D: usize>(
        &mut self,
        name: &str,
        tensor: &Tensor<D>,
        grad: &[f32],
    ) -> Result<Tensor<D>, LearnError> {
        let plain = tensor.clone().inner();
        let device = plain.device();
        let shape = plain.dims();
        let mut weights = host(plain)?;
        LearnError::check(name, weights.len(), grad.len())?;
        if !self.moments.contains_key(name) {
            let zeros = vec![0.0; weights.len()];
            let fresh = Moments { shape: shape.to_vec(), m: zeros.clone(), v: zeros };
            self.moments.insert(name.to_owned(), fresh);
        }
        let moments = self.moments.get_mut(name).expect("inserted above if it was missing");
        let (b1, b2) = (self.config.beta1 as f32, self.config.beta2 as f32);
        let (c1, c2) = ((1.0 - self.config.beta1) as f32, (1.0 - self.config.beta2) as f32);
        let (scale, decay, eps) = (self.scale, self.decay, self.config.eps as f32);
        let (step, correction2) = (self.lr * self.correction1, self.correction2);
        let rows = weights.iter_mut().zip(grad).zip(moments.m.iter_mut().zip(&mut moments.v));
        // 0 for finite numbers, NaN otherwise.
        let mut witness = 0.0f32;
        for ((w, &g), (m, v)) in rows {
            let g = g * scale;
            *m = b1 * *m + c1 * g;
            *v = b2 * *v + c2 * g * g;
            *w = *w * decay - step * *m / ((*v * correction2).sqrt() + eps);
            witness += *w * 0.0;
        }
        if witness != 0.0 {
            return Err(LearnError::NotFinite { tensor: name.to_owned(), steps: self.steps });
        }
        let updated = Tensor::<D>::from_data(TensorData::new(weights, shape), &device);
        Ok(updated.autodiff().require_grad())
    }
}
