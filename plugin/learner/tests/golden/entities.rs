//! A gradient step of PPO through the encoder of sets.

use crate::case::{Case, host};
use crate::update::{After, check_gradients};
use burn::tensor::{Tensor, TensorData};
use playbot_learner::nn::{ActionBatch, Adam, AdamConfig, Dist, Parameters, tracked};
use playbot_learner::policy::{Actor, Critic, NetShape};
use playbot_learner::ppo::{Minibatch, PpoBatch, PpoNets, gradient_step, normalize_advantages};
use playbot_learner::rng::Streams;
use playbot_learner::{
    ActionSpace, Actions, DeviceKind, EntityBlock, EntityKind, PolicySpec, PpoConfig, PpoLearner, StdKind,
};

/// The sets of the case, as its script names them.
const SETS: [EntityBlock; 2] =
    [EntityBlock { start: 1, slots: 3, width: 2 }, EntityBlock { start: 11, slots: 2, width: 1 }];

fn nets(case: &Case, kind: DeviceKind) -> PpoNets {
    let (space, hidden) = (ActionSpace::Discrete(case.dim("K")), vec![case.dim("hidden")]);
    let entities = EntityKind::Set { hidden: case.dim("encoded"), blocks: SETS.to_vec() };
    let config = PpoConfig { entities, hidden: hidden.clone(), activation: case.activation(), ..PpoConfig::default() };
    let spec = PolicySpec { obs: case.dim("obs").into(), latent: 0, action_space: space };
    let learner = PpoLearner::new(config, spec, 1, kind).expect("good settings");
    let (mut rng, device) = (Streams::new(0).stream("nets", 0), kind.plain());
    let obs_dim = 2 + SETS.len() * (2 * case.dim("encoded") + 1);
    let shape = NetShape { obs_dim, latent: 0, hidden, activation: case.activation() };
    let entities = learner.nets().actor.entities.clone();
    let mut actor = Actor { entities, ..Actor::new(&shape, space, StdKind::Vector, &mut rng, &device) };
    let mut critic = Critic::new(&shape, &mut rng, &device);
    case.fill(&mut actor, "param.", "actor", kind);
    case.fill(&mut critic, "param.", "critic", kind);
    tracked(&PpoNets { actor, critic, intrinsic: None })
}

fn minibatch(case: &Case, kind: DeviceKind) -> Minibatch {
    let device = kind.plain();
    let column = |name: &str| Tensor::<1>::from_floats(case.f32s(name).as_slice(), &device);
    let obs: Tensor<2> =
        Tensor::from_data(TensorData::new(case.f32s("in.obs"), case.shape("in.obs").to_vec()), &device);
    let mut advantages = case.f32s("in.advantages");
    normalize_advantages(&mut advantages);
    let actions = Actions::Discrete(case.f32s("in.actions").into_iter().map(|a| a as u32).collect());
    Minibatch {
        inputs: obs.into(),
        augmented: None,
        recall: None,
        left: None,
        logit_offsets: None,
        ppo: PpoBatch {
            actions: ActionBatch::new(&actions, &device),
            old_log_probs: column("in.old_log_probs"),
            advantages: Tensor::from_floats(advantages.as_slice(), &device),
            old_values: column("in.old_values"),
            returns: column("in.returns"),
        },
        teacher: None,
        intrinsic_returns: None,
    }
}

#[test]
fn golden_ppo_entities() {
    let case = Case::of_entities("ppo_entities");
    assert_eq!(case.f32s("in.obs").len(), case.dim("rows") * case.dim("obs"));
    for kind in DeviceKind::CPU {
        let (mut nets, batch) = (nets(&case, kind), minibatch(&case, kind));
        let x = nets.actor.join(&batch.inputs).expect("vectors");
        case.check("out.encoded", &host(x.clone()));
        let Dist::Categorical { log_probs } = nets.actor.forward(x.clone()) else { panic!("actions are discrete") };
        case.check("out.log_probs", &host(log_probs));
        case.check("out.values", &host(nets.critic.forward(x, None)));
        let config = PpoConfig {
            clip: case.number("clip"),
            vf_coef: case.number("vf_coef"),
            ent_coef: case.number("ent_coef"),
            max_grad_norm: case.number("max_grad_norm"),
            ..PpoConfig::default()
        };
        let mut still = nets.clone();
        let mut adam = Adam::new(AdamConfig { beta1: 0.0, beta2: 0.0, ..AdamConfig::default() });
        let unclipped = PpoConfig { max_grad_norm: 1e30, ..config.clone() };
        gradient_step(&mut still, &mut adam, &batch, &unclipped, None, 0.0).expect("finite");
        check_gradients(&case, "step1_grad.", ("", ""), &mut still, &adam);
        let mut adam = Adam::new(AdamConfig { eps: case.number("adam_eps"), ..AdamConfig::default() });
        let step = gradient_step(&mut nets, &mut adam, &batch, &config, None, case.number("lr")).expect("finite");
        for (name, got) in [
            ("policy_loss", step.policy_loss),
            ("value_loss", step.value_loss),
            ("entropy", step.entropy),
            ("total_loss", step.total_loss),
            ("approx_kl", step.approx_kl),
            ("clip_fraction", step.clip_fraction),
            ("grad_norm", step.grad_norm),
        ] {
            case.check_number(name, got);
        }
        nets.visit("", &mut After(&case));
    }
    case.finish(&[]);
}
