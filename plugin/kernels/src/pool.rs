//! The mean and the maximum of each feature over groups of rows, as one operation.
//!
//! A group has as many rows as it needs, so that absent things of a set cost nothing. The rows of a group are added in
//! their order, on any number of threads.

#![allow(deprecated, reason = "ndarray is kept as a second opinion on flex")]

use crate::{
    host_numbers::{HostNumbers, tensor},
    kept_memory::{OF_A_MOVE, share},
};
use burn::{
    backend::{
        Autodiff, Backend, Dispatch, Flex, NdArray, TensorMetadata,
        autodiff::{
            checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
            grads::Gradients,
            ops::{Backward, Ops, OpsKind, unary},
        },
        backend_extension,
        tensor::FloatTensor,
    },
    tensor::Tensor,
};

/// Groups that a thread takes at a time.
const GROUPS: usize = 64;

/// Returns `[groups, 2 * features]` for the rows of `x`, `[rows, features]`: the mean of each feature over the rows of a
/// group, then its maximum. Group `g` has the next `counts[g]` rows. A group without rows has zeros, and rows behind the
/// last group are not read. On a device with kernels.
///
/// The gradient of a maximum goes to the first row that has it.
///
/// # Panics
/// If there are fewer rows than the groups have.
pub fn pool(x: Tensor<2>, counts: Vec<usize>) -> Tensor<2> {
    let rows: usize = counts.iter().sum();
    assert!(rows <= x.dims()[0], "{rows} rows in groups, but only {} rows", x.dims()[0]);
    Tensor::from_dispatch(Dispatch::kernel_pool(x.into_dispatch(), counts))
}

/// A backend with the operation.
#[backend_extension(Flex, NdArray, Autodiff)]
pub(crate) trait Pooling: Backend {
    /// Pools as [`pool`] does.
    fn kernel_pool(x: FloatTensor<Self>, counts: Vec<usize>) -> FloatTensor<Self>;
}

impl Pooling for Flex {
    fn kernel_pool(x: FloatTensor<Self>, counts: Vec<usize>) -> FloatTensor<Self> {
        forward::<Self>(&x, &counts)
    }
}

impl Pooling for NdArray {
    fn kernel_pool(x: FloatTensor<Self>, counts: Vec<usize>) -> FloatTensor<Self> {
        forward::<Self>(&x, &counts)
    }
}

impl<B: Pooling + HostNumbers, C: CheckpointStrategy> Pooling for Autodiff<B, C> {
    fn kernel_pool(x: FloatTensor<Self>, counts: Vec<usize>) -> FloatTensor<Self> {
        let (x, node) = x.into_parts();
        let y = forward::<B>(&x, &counts);
        match Pooled.prepare::<C>([node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((x, y.clone(), counts), y),
            OpsKind::UnTracked(prep) => prep.finish(y),
        }
    }
}

#[derive(Debug)]
struct Pooled;

impl<B: Pooling + HostNumbers> Backward<B, 1> for Pooled {
    /// x, the result, and the rows of each group.
    type State = (FloatTensor<B>, FloatTensor<B>, Vec<usize>);

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (x, y, counts) = ops.state;
        unary::<B, _>(ops.parents, ops.node, grads, |grad| {
            let [rows, features] = x.shape().dims();
            let of_x = gradient(&B::numbers(&grad), &B::numbers(&x), &B::numbers(&y), features, &counts);
            tensor::<B>(of_x, [rows, features], &x.device())
        });
    }
}

fn forward<B: HostNumbers>(x: &FloatTensor<B>, counts: &[usize]) -> FloatTensor<B> {
    let [_, features] = x.shape().dims();
    let pooled = pooled(&B::numbers(x), features, counts);
    tensor::<B>(pooled, [counts.len(), 2 * features], &x.device())
}

/// Returns mean and maximum of each group.
fn pooled(x: &[f32], features: usize, counts: &[usize]) -> Vec<f32> {
    let mut firsts = Vec::with_capacity(counts.len());
    let mut rows = 0;
    for &count in counts {
        firsts.push(rows);
        rows += count;
    }
    let mut out = vec![0.0; counts.len() * 2 * features];
    share(&mut out, (GROUPS * 2 * features).max(1), rows * features * OF_A_MOVE, |piece, out| {
        for (g, out) in out.chunks_exact_mut((2 * features).max(1)).enumerate() {
            let (first, count) = (firsts[piece * GROUPS + g], counts[piece * GROUPS + g]);
            let (mean, most) = out.split_at_mut(features);
            for (k, row) in x[first * features..(first + count) * features].chunks_exact(features.max(1)).enumerate() {
                mean.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
                match k {
                    0 => most.copy_from_slice(row),
                    // A NaN stays one, so that it is found.
                    _ => most.iter_mut().zip(row).for_each(|(most, &x)| {
                        if x > *most || x.is_nan() {
                            *most = x;
                        }
                    }),
                }
            }
            let share = 1.0 / count.max(1) as f32;
            mean.iter_mut().for_each(|mean| *mean *= share);
        }
    });
    out
}

/// Returns the gradient by x.
fn gradient(grad: &[f32], x: &[f32], y: &[f32], features: usize, counts: &[usize]) -> Vec<f32> {
    let mut of_x = vec![0.0; x.len()];
    let mut first = 0;
    let groups = grad.chunks_exact((2 * features).max(1)).zip(y.chunks_exact((2 * features).max(1)));
    for (&count, (grad, y)) in counts.iter().zip(groups) {
        let (of_mean, of_most) = grad.split_at(features);
        let share = 1.0 / count.max(1) as f32;
        let rows = first * features..(first + count) * features;
        for to in of_x[rows.clone()].chunks_exact_mut(features.max(1)) {
            to.iter_mut().zip(of_mean).for_each(|(to, grad)| *to = grad * share);
        }
        for (feature, (&most, grad)) in y[features..].iter().zip(of_most).enumerate() {
            let place = x[rows.clone()].iter().skip(feature).step_by(features).position(|&x| x == most);
            if let Some(row) = place {
                of_x[(first + row) * features + feature] += grad;
            }
        }
        first += count;
    }
    of_x
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_learner::DeviceKind;
    use playbot_learner::nn::{host, matrix};

    #[test]
    fn mean_and_maximum_by_hand() {
        for device in DeviceKind::CPU {
            let x = vec![1.0, -4.0, 3.0, -2.0, 7.0, 7.0, 7.0, 9.0, 99.0, 99.0];
            let x = matrix(x, 5, 2, &device.plain().autodiff()).require_grad();
            let y = pool(x.clone(), vec![2, 0, 2]);
            let got = host(y.clone().inner()).expect("readable");
            assert_eq!(got, [2.0, -3.0, 3.0, -2.0, 0.0, 0.0, 0.0, 0.0, 7.0, 8.0, 7.0, 9.0]);
            let probe = matrix((1..=12).map(|i| i as f32).collect(), 3, 4, &device.plain());
            let grads = (y * probe).sum().backward();
            let of_x = host(x.grad(&grads).expect("tracked")).expect("readable");
            // Of two equal maxima the first one has the gradient; the row behind the groups has none.
            assert_eq!(of_x, [0.5, 1.0, 3.5, 5.0, 15.5, 5.0, 4.5, 17.0, 0.0, 0.0]);
        }
    }

    #[test]
    fn groups_on_three_threads_are_those_on_one() {
        let counts: Vec<usize> = (0..900).map(|g| (g * 7) % 5).collect();
        let rows: usize = counts.iter().sum();
        let x: Vec<f32> = (0..rows * 40).map(|i| ((i * 7919) % 1009) as f32 / 100.0 - 5.0).collect();
        let one = pooled(&x, 40, &counts);
        let three =
            playbot_learner::Workers::new(3).bound(|| playbot_learner::among_awake_workers(|| pooled(&x, 40, &counts)));
        assert!(one == three && one.iter().any(|x| *x > 4.0));
    }
}
