//! The image encoder of IMPALA: every stage, and the gradients of a sum of features and of a decoder's loss.

use crate::case::{Case, host, number};
use burn::tensor::Tensor;
use playbot_learner::nn::{ActionBatch, CnnKind, Dist, ImageNet, NamedGrads, ObsBatch, parameter_count, tracked};
use playbot_learner::policy::{Actor, NetShape};
use playbot_learner::rng::Streams;
use playbot_learner::{ActionSpace, DeviceKind, ImageShape, StdKind};

/// Returns the decoder of the case, with its image encoder.
fn actor(case: &Case, device: DeviceKind) -> Actor {
    let [channels, height, width] = case.sizes("image")[..] else { panic!("an image has three sizes") };
    let kind = CnnKind::Impala { channels: case.sizes("channels"), feature: case.dim("feat") };
    case.assert_fixed("decoder_input", "[skill, feature]");
    let mut rng = Streams::new(0).stream("nets", 0);
    let image = ImageShape { channels, height, width };
    let mut cnn = ImageNet::new(&kind, image, &mut rng, &device.plain()).expect("it fits");
    let shape = NetShape {
        obs_dim: cnn.features(),
        latent: case.dim("skill"),
        hidden: case.hidden_layers("param.dec"),
        activation: case.activation(),
    };
    let space = ActionSpace::Discrete(case.dim("K"));
    let mut actor = Actor::new(&shape, space, StdKind::Vector, &mut rng, &device.plain());
    case.fill(&mut cnn, "param.", "cnn", device);
    case.fill(&mut actor, "param.", "decoder", device);
    case.check_number("cnn_param_count", parameter_count(&cnn) as f64);
    Actor { cnn: Some(cnn), ..actor }
}

fn images(case: &Case, device: DeviceKind) -> ObsBatch {
    let shape = case.shape("in.images").try_into().expect("four sizes");
    ObsBatch::pixels(case.bytes("in.images"), shape, &device.plain())
}

fn decode(case: &Case, actor: &Actor, features: Tensor<2>) -> Tensor<2> {
    let skill = case.tensor::<2>("in.skill", &features.device());
    actor.net.forward(Tensor::cat(vec![skill, features], 1))
}

#[test]
fn golden_impala_small() {
    let case = Case::load("impala_small");
    for device in DeviceKind::CPU {
        let mut actor = tracked(&actor(&case, device));
        let images = images(&case, device);
        stages(&case, &actor, &images);

        let features = actor.observe(&images).expect("images");
        case.check("out.feature", &host(features.clone()));
        let probed = (features * case.tensor::<2>("in.probe_feature", &device.plain())).sum();
        case.check_number("feature_probe.loss", number(probed.clone()));
        let cnn = actor.cnn.as_mut().expect("there is one");
        let grads = NamedGrads::read(cnn, "cnn", &probed.backward()).expect("readable");
        check_gradients(&case, "feature_probe", &grads);
        case.check_number("feature_probe.grad_norm.total", grads.norm());

        let features = actor.observe(&images).expect("images");
        let logits = decode(&case, &actor, features);
        case.check("out.logits", &host(logits.clone()));
        let dist = Dist::categorical(logits);
        let Dist::Categorical { log_probs } = &dist else { panic!("made so") };
        case.check("out.log_probs", &host(log_probs.clone()));
        let actions = ActionBatch::new(&case.actions("in.actions"), &device.plain());
        let nll = dist.log_prob(&actions).expect("discrete").mean().neg();
        case.check_number("nll.loss", number(nll.clone()));
        let grads = nll.backward();
        let cnn = NamedGrads::read(actor.cnn.as_mut().expect("there is one"), "cnn", &grads).expect("readable");
        let net = NamedGrads::read(&mut actor.net, "decoder", &grads).expect("readable");
        check_gradients(&case, "nll", &cnn);
        check_gradients(&case, "nll", &net);
        case.check_number("nll.grad_norm.total", cnn.norm().hypot(net.norm()));
    }
    case.finish(&[]);
}

fn stages(case: &Case, actor: &Actor, images: &ObsBatch) {
    let (Some(ImageNet::Impala(net)), ObsBatch::Image(pixels)) = (&actor.cnn, images) else {
        panic!("an IMPALA over images");
    };
    let mut x = pixels.clone();
    for (k, stage) in net.stages.iter().enumerate() {
        x = stage.forward(x);
        case.check(&format!("out.stage{k}"), &host(x.clone()));
    }
}

fn check_gradients(case: &Case, loss: &str, grads: &NamedGrads) {
    for (name, values) in grads.iter() {
        case.check_parameter(&format!("grad.{loss}."), name, values);
        case.check_norm(&format!("{loss}.grad_norm."), name, values);
    }
}

/// Runs only on flex: the small case is enough for the other backend, which is a second opinion.
#[test]
fn golden_impala_paper_size() {
    let case = Case::load("impala_paper_size");
    let device = DeviceKind::Flex;
    let actor = actor(&case, device);
    let features = actor.observe(&images(&case, device)).expect("images");
    let sum: f64 = host(features.clone()).into_iter().map(f64::from).sum();
    case.check_number("feature_sum", sum);
    case.check("out.feature", &host(features.clone()));
    case.check("out.logits", &host(decode(&case, &actor, features)));
    case.finish(&[]);
}
