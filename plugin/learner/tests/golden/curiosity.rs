//! Curiosity: errors, rewards, endless advantages, and the losses with a second head of the critic.
//!
//! Expected numbers are those of `tests/fixtures/curiosity`, which PyTorch computed from the published formulas.

use crate::case::{Case, host, number};
use crate::update::check_gradients;
use burn::tensor::{Tensor, TensorData};
use playbot_learner::nn::{ActionBatch, Adam, AdamConfig, Linear, Mlp, NamedGrads, ObsBatch, frozen, tracked};
use playbot_learner::norm::RewardNormalizer;
use playbot_learner::policy::{Actor, Critic, NetShape};
use playbot_learner::ppo::{
    Minibatch, PpoBatch, PpoNets, Predictor, RndNet, combined_advantages, endless_gae, gradient_step,
    normalize_advantages, prediction_errors,
};
use playbot_learner::rng::Streams;
use playbot_learner::{ActionSpace, DeviceKind, PpoConfig, StdKind};

/// Returns the errors of the case's predictor, after a check of its loss and gradient.
fn errors(case: &Case, kind: DeviceKind) -> Vec<f32> {
    let device = kind.plain();
    let net = |name: &str| {
        let mut rng = Streams::new(0).stream("nets", 0);
        let (inputs, outputs) = (case.dim("obs"), case.dim("features"));
        let hidden = case.hidden_layers(&format!("param.{name}"));
        RndNet { cnn: None, net: Mlp::new(inputs, &hidden, outputs, case.activation(), 1.0, &mut rng, &device) }
    };
    let (mut target, mut predictor) = (net("target"), Predictor(net("curiosity.predictor")));
    case.fill(&mut target, "param.", "target", kind);
    case.fill(&mut predictor, "param.", "", kind);
    let mut predictor = tracked(&predictor);
    let x = ObsBatch::Vector(case.tensor("in.x", &device));
    let wanted = frozen(&target).forward(&x).expect("vectors");
    let errors = prediction_errors(predictor.0.forward(&x).expect("vectors"), wanted.autodiff());
    let loss = errors.clone().mean();
    case.check_number("predictor_loss", number(loss.clone()));
    let grads = NamedGrads::take(&mut predictor, "", loss.backward()).expect("readable");
    for (name, values) in grads.iter() {
        case.check_parameter("grad.", name, values);
    }
    host(errors)
}

/// Returns the returns of intrinsic rewards, and the advantages of both kinds of rewards.
fn advantages(case: &Case, errors: &[f32]) -> (Vec<f32>, Vec<f32>) {
    let mut normalizer = RewardNormalizer::new(case.number("gamma"));
    normalizer.update(errors, &vec![false; errors.len()], case.dim("envs")).expect("they fit");
    let rewards: Vec<f32> = errors.iter().map(|&error| normalizer.scale(error)).collect();
    case.check("out.rewards", &rewards);
    let (values, next_values) = (case.f32s("in.intrinsic_values"), case.f32s("in.next_intrinsic_values"));
    let endless = endless_gae(&rewards, &values, &next_values, case.number("gamma"), case.number("lambda"));
    case.check("out.intrinsic_advantages", &endless.advantages);
    case.check("out.intrinsic_returns", &endless.returns);
    let weights = (case.number("extrinsic"), case.number("intrinsic"));
    let advantages = combined_advantages(&case.f32s("in.extrinsic_advantages"), &endless.advantages, weights);
    case.check("out.advantages", &advantages);
    (endless.returns, advantages)
}

fn check_losses(case: &Case, kind: DeviceKind, returns: &[f32], mut advantages: Vec<f32>) {
    let device = kind.plain();
    let shape = NetShape {
        obs_dim: case.dim("obs"),
        latent: 0,
        hidden: case.hidden_layers("param.critic"),
        activation: case.activation(),
    };
    let mut rng = Streams::new(0).stream("nets", 0);
    let space = ActionSpace::Discrete(case.dim("K"));
    let mut nets = PpoNets {
        actor: Actor::new(&shape, space, StdKind::Vector, &mut rng, &device),
        critic: Critic::new(&shape, &mut rng, &device),
        intrinsic: Some(Linear::new(case.dim("hidden"), 1, 1.0, &mut rng, &device)),
    };
    case.fill(&mut nets, "param.", "", kind);
    normalize_advantages(&mut advantages);
    let column = |values: &[f32]| Tensor::<1>::from_data(TensorData::new(values.to_vec(), [values.len()]), &device);
    let batch = Minibatch {
        inputs: case.tensor::<2>("in.obs", &device).into(),
        augmented: None,
        recall: None,
        left: None,
        logit_offsets: None,
        free: None,
        ppo: PpoBatch {
            actions: ActionBatch::new(&case.actions("in.actions"), &device),
            old_log_probs: case.tensor("in.old_log_probs", &device),
            advantages: column(&advantages),
            old_values: case.tensor("in.old_values", &device),
            returns: case.tensor("in.returns", &device),
        },
        teacher: None,
        intrinsic_returns: Some(column(returns)),
    };
    let config = PpoConfig {
        clip: case.number("clip"),
        vf_coef: case.number("vf_coef"),
        ent_coef: case.number("ent_coef"),
        max_grad_norm: 1e30,
        ..PpoConfig::default()
    };
    // With learning rate 0 and β = 0 the first moment is the gradient.
    let mut adam = Adam::new(AdamConfig { beta1: 0.0, beta2: 0.0, ..AdamConfig::default() });
    let mut nets = tracked(&nets);
    let step = gradient_step(&mut nets, &mut adam, &batch, &config, None, 0.0).expect("finite");
    case.check_number("policy_loss", step.policy_loss);
    case.check_number("value_loss", step.value_loss);
    case.check_number("intrinsic_value_loss", step.intrinsic_value_loss);
    case.check_number("total_loss", step.total_loss);
    check_gradients(case, "step1_grad.", ("", ""), &mut nets, &adam);
}

#[test]
fn golden_curiosity() {
    let case = Case::of_curiosity("rnd_step");
    for kind in DeviceKind::CPU {
        let errors = errors(&case, kind);
        case.check("out.errors", &errors);
        let (returns, advantages) = advantages(&case, &errors);
        check_losses(&case, kind, &returns, advantages);
    }
    case.finish(&[]);
}
