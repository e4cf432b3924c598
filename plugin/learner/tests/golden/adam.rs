//! Steps of Adam on one parameter of any shape, in several variants.

use crate::case::{Case, host};
use burn::tensor::Tensor;
use playbot_learner::DeviceKind;
use playbot_learner::nn::{Adam, AdamConfig, NamedGrads, ParamVisitor, Parameters, tracked};

/// All numbers of the parameter in a row: Adam treats each by itself.
#[derive(Clone)]
struct One(Tensor<1>);

impl Parameters for One {
    fn visit<V: ParamVisitor>(&mut self, _: &str, visitor: &mut V) {
        visitor.visit("p", &mut self.0);
    }
}

#[test]
fn golden_adam_steps() {
    let case = Case::load("adam_steps");
    // One gradient of the parameter's shape for each step.
    let (start, gradients) = (case.f32s("param.p"), case.f32s("in.grads"));
    assert_eq!(case.shape("in.grads")[1..], *case.shape("param.p"));
    let variants = case.hyper("variants").as_object().expect("variants").clone();
    for kind in DeviceKind::CPU {
        let device = kind.plain();
        let flat = |values: &[f32]| Tensor::<1>::from_floats(values, &device);
        for (variant, hyper) in &variants {
            let config = AdamConfig {
                beta1: case.number("beta1"),
                beta2: case.number("beta2"),
                eps: hyper["eps"].as_f64().expect("eps"),
                weight_decay: hyper["weight_decay"].as_f64().expect("weight decay"),
            };
            let mut adam = Adam::new(config);
            let mut network = tracked(&One(flat(&start)));
            let (mut p, mut m, mut v) = (Vec::new(), Vec::new(), Vec::new());
            for (step, gradient) in gradients.chunks_exact(start.len()).enumerate() {
                // The gradient of sum(p * g) is g.
                let grads = (network.0.clone() * flat(gradient)).sum().backward();
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
    // The corrected moments are not visible: the parameter shows whether they are right.
    let hidden = |variant: &String| [format!("out.{variant}.m_hat"), format!("out.{variant}.v_hat")];
    let hidden: Vec<String> = variants.keys().flat_map(hidden).chain(["bias_correction".to_owned()]).collect();
    case.finish(&hidden.iter().map(String::as_str).collect::<Vec<_>>());
}
