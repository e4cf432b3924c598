//! The trunk as an operation of the flex backend, with its backward pass.

use super::backward::gradients;
use super::forward::{SavedActivations, features, features_and_saved};
use super::layer::Weights;
use super::plan::Plan;
use crate::nn::cpu::host_numbers::{HostNumbers, tensor};
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, DispatchDevice, Flex, TensorMetadata, backend_extension};
use burn::tensor::{Device, Tensor};
use rayon::prelude::*;
use std::sync::Arc;

/// Returns whether `device` has this operation.
pub(super) fn is_flex(device: &Device) -> bool {
    matches!(device.clone().inner().as_dispatch(), DispatchDevice::Flex(_))
}

/// Returns the features of `pixels`, on flex; `params` has the parameters of all layers, one after the other.
pub(super) fn trunk(pixels: Tensor<4>, params: Tensor<1>, plan: Arc<Plan>) -> Tensor<2> {
    Tensor::from_dispatch(Dispatch::trunk(pixels.into_dispatch(), params.into_dispatch(), plan))
}

/// A backend with trunks.
#[backend_extension(Flex, Autodiff)]
pub(super) trait Trunks: Backend {
    /// Returns the features as [`trunk`] does.
    fn trunk(pixels: FloatTensor<Self>, params: FloatTensor<Self>, plan: Arc<Plan>) -> FloatTensor<Self>;
}

impl Trunks for Flex {
    fn trunk(pixels: FloatTensor<Self>, params: FloatTensor<Self>, plan: Arc<Plan>) -> FloatTensor<Self> {
        let weights = weights(&plan, &Self::numbers(&params), false);
        let values = features(&plan, &weights, &Self::numbers(&pixels));
        tensor::<Self>(values, [pixels.shape()[0], plan.features()], &pixels.device())
    }
}

impl<B: Trunks + HostNumbers, C: CheckpointStrategy> Trunks for Autodiff<B, C> {
    fn trunk(pixels: FloatTensor<Self>, params: FloatTensor<Self>, plan: Arc<Plan>) -> FloatTensor<Self> {
        let ((pixels, _), (params, node)) = (pixels.into_parts(), params.into_parts());
        match Convolutions.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let weights = weights(&plan, &B::numbers(&params), true);
                let (values, saved) = features_and_saved(&plan, &weights, &B::numbers(&pixels));
                let values = tensor::<B>(values, [pixels.shape()[0], plan.features()], &pixels.device());
                prep.finish(Arc::new(Run { plan, weights, saved }), values)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::trunk(pixels, params, plan)),
        }
    }
}

/// The data that a forward pass keeps for the backward pass.
#[derive(Debug)]
struct Run {
    plan: Arc<Plan>,
    weights: Vec<Weights>,
    saved: SavedActivations,
}

#[derive(Debug)]
struct Convolutions;

impl<B: Trunks + HostNumbers> Backward<B, 1> for Convolutions {
    type State = Arc<Run>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let grad = grads.consume::<B>(&ops.node);
        let (run, [params]) = (ops.state, ops.parents);
        if let Some(params) = params {
            let found = gradients(&run.plan, &run.weights, &run.saved, &B::numbers(&grad));
            let len = found.len();
            grads.register::<B>(params.id, tensor::<B>(found, [len], &grad.device()));
        }
    }
}

fn weights(plan: &Plan, mut params: &[f32], backward: bool) -> Vec<Weights> {
    let mut of_layers = Vec::new();
    for layer in &plan.layers {
        let (own, rest) = params.split_at(layer.params());
        of_layers.push(own);
        params = rest;
    }
    let weights = plan.layers.par_iter().zip(of_layers).map(|(layer, params)| layer.weights(params, backward));
    weights.collect()
}
