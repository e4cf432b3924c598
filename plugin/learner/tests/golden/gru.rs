//! Recurrent layers, one and two directions, one and two layers, with and without a starting state.

use crate::case::{Case, host};
use burn::tensor::Tensor;
use playbot_learner::DeviceKind;
use playbot_learner::nn::{Gru, NamedGrads, tracked};
use playbot_learner::rng::Streams;

fn check(case: &Case, stack: &str, weights: &str, kind: DeviceKind) {
    let device = kind.plain();
    let (inputs, hidden, steps) = (case.dim("I"), case.dim("H"), case.dim("T"));
    let directions = if case.has(&format!("param.{weights}.weight_ih_l0_reverse")) { 2 } else { 1 };
    let layers = (0..).take_while(|k| case.has(&format!("param.{weights}.weight_ih_l{k}"))).count();
    let mut rng = Streams::new(0).stream("gru", 0);
    let mut gru = Gru::new(inputs, hidden, layers, directions == 2, &mut rng, &device);
    case.fill(&mut gru, "param.", &format!("gru.{weights}"), kind);
    let mut gru = tracked(&gru);

    let x = case.tensor::<3>("in.x", &device).autodiff().require_grad();
    let batch = case.dim("B");
    let sequence: Tensor<2> = x.clone().swap_dims(0, 1).reshape([steps * batch, inputs]);
    let initial = (stack == "bi2_h0").then(|| {
        let all = case.tensor::<3>("in.h0_bi2", &device);
        (0..layers).map(|k| all.clone().slice([2 * k..2 * k + 2, 0..batch, 0..hidden])).collect()
    });
    let summary = (initial.is_none() && directions == 2).then(|| gru.summary(sequence.clone(), steps));
    let (outputs, last) = gru.forward(sequence, steps, initial);
    let output: Tensor<3> = outputs.reshape([steps, batch, directions * hidden]).swap_dims(0, 1);
    case.check(&format!("out.{stack}.output"), &host(output.clone()));
    let states: Tensor<3> = Tensor::cat(last, 0);
    case.check(&format!("out.{stack}.h_n"), &host(states.clone()));
    if let Some(summary) = summary {
        case.check(&format!("out.{stack}.feature"), &host(summary));
    } else if directions == 2 {
        let top = states.slice([2 * layers - 2..2 * layers, 0..batch, 0..hidden]);
        let feature: Tensor<2> = top.swap_dims(0, 1).reshape([batch, 2 * hidden]);
        case.check(&format!("out.{stack}.feature"), &host(feature));
    }
    let probe = if directions == 2 { "in.probe_bi" } else { "in.probe_uni" };
    let grads = (output * case.tensor::<3>(probe, &device)).sum().backward();
    case.check(&format!("grad.{stack}.x"), &host(x.grad(&grads).expect("tracked")));
    if stack == weights {
        let grads = NamedGrads::read(&mut gru, &format!("gru.{weights}"), &grads).expect("readable");
        for (name, values) in grads.iter() {
            case.check_parameter("grad.", name, values);
        }
    }
}

#[test]
fn golden_gru_stack() {
    let case = Case::load("gru_stack");
    case.assert_fixed("gates", "rows r, z, n");
    case.assert_fixed("reset_after", true);
    case.assert_fixed("batch_first", true);
    for kind in DeviceKind::CPU {
        for (stack, weights) in [("uni", "uni"), ("bi", "bi"), ("bi2", "bi2"), ("bi2_h0", "bi2")] {
            check(&case, stack, weights, kind);
        }
    }
    case.finish(&[]);
}
