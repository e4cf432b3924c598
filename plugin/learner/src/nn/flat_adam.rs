//! Adam on the device of the parameters: on a graphics card, without reading anything back.

use super::Adam;
use super::moments::FlatMoments;
use super::params::{ParamVisitor, Parameters};
use burn::tensor::{Gradients, Tensor};

impl Adam {
    /// Does [`Adam::step`] after clipping by the global norm, which is returned, `[1]`. The moments stay on the
    /// network's device.
    ///
    /// If a gradient is not finite, the returned norm is not finite, and the weights are lost.
    pub(crate) fn step_on_device<M: Parameters>(
        &mut self,
        network: &mut M,
        mut grads: Gradients,
        lr: f64,
        max_norm: f64,
    ) -> Tensor<1> {
        let mut read = Flatten { grads: &mut grads, parts: Vec::new(), layout: Vec::new() };
        network.visit("", &mut read);
        let Flatten { parts, layout, .. } = read;
        let grad = Tensor::cat(parts, 0);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::{Activation, AdamConfig, Mlp, NamedGrads, host, matrix, tracked};
    use crate::rng::{Streams, normal};

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
