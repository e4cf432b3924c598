//! Slow copies of networks.

use crate::nn::{ParamVisitor, Parameters};
use burn::tensor::Tensor;
use std::vec::IntoIter;

/// Sets target = tau · source + (1 - tau) · target, parameter by parameter (Polyak averaging; a plain copy for tau =
/// 1).
///
/// `target` stays untracked. Both must be of one architecture.
pub fn soft_update<M: Parameters + Clone>(target: &mut M, source: &M, tau: f64) {
    let mut flat = Flat(Vec::new());
    source.clone().visit("", &mut flat);
    target.visit("", &mut Mix { source: flat.0.into_iter(), tau });
}

struct Flat(Vec<Tensor<1>>);

impl ParamVisitor for Flat {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        let len = tensor.dims().iter().product::<usize>();
        self.0.push(tensor.clone().inner().reshape([len]));
    }
}

struct Mix {
    source: IntoIter<Tensor<1>>,
    tau: f64,
}

impl ParamVisitor for Mix {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        let source = self.source.next().expect("one architecture, so as many parameters");
        let source = source.reshape(tensor.dims());
        let slow = tensor.clone().inner();
        *tensor = if self.tau < 1.0 { slow * (1.0 - self.tau) + source * self.tau } else { source };
    }
}
