//! Five steps of Adam on one matrix, in four variants.

use crate::case::{Case, host};
use burn::tensor::{Tensor, TensorData};
use playbot_learner::DeviceKind;
use playbot_learner::nn::{Adam, AdamConfig, NamedGrads, ParamVisitor, Parameters, tracked};

#[derive(Clone)]
struct One(Tensor<2>);

impl Parameters for One {
    fn visit<V: ParamVisitor>(&mut self, _: &str, visitor: &mut V) {
        visitor.visit("p", &mut self.0);
    }
}

#[test]
fn golden_adam_steps() {
    let case = Case::load("adam_steps");
    // One gradient of the parameter's shape for each step.
    let (gradients, shape) = (case.f32s("in.grads"), case.shape("param.p").to_vec());
    let numbers: usize = shape.iter().product();
    assert_eq!(case.shape("in.grads")[1..], shape);
    let variants = case.hyper("variants").as_object().expect("variants").clone();
    for kind in DeviceKind::ALL {
        let device = kind.plain();
        for (variant, hyper) in &variants {
            let config = AdamConfig {
                beta1: case.number("beta1"),
                beta2: case.number("beta2"),
                eps: hyper["eps"].as_f64().expect("eps"),
                weight_decay: hyper["weight_decay"].as_f64().expect("weight decay"),
            };
            let mut adam = Adam::new(config);
            let mut network = tracked(&One(case.tensor("param.p", &device)));
            let (mut p, mut m, mut v) = (Vec::new(), Vec::new(), Vec::new());
            for (step, gradient) in gradients.chunks_exact(numbers).enumerate() {
                // The gradient of sum(p * g) is g.
                let g = Tensor::<2>::from_data(TensorData::new(gradient.to_vec(), shape.clone()), &device);
                let grads = (network.0.clone() * g).sum().backward();
                let grads = NamedGrads::read(&mut network, "", &grads).expect("readable");
                let lr = hyper["lr"][step].as_f64().expect("lr");
                adam.step(&mut network, "", &grads, lr, 1.0).expect("finite");
                p.extend(host(network.0.clone().inner()));
                let moments = adam.moments("p").expect("updated");
                m.extend_from_slice(moments.0);
                v.extend_from_slice(moments.1);
            }
            case.check(&format!("out.{variant}.param"), &p);
            case.check(&format!("out.{variant}.m"), &m);
            case.check(&format!("out.{variant}.v"), &v);
        }
    }
}
