//! A gradient step of PPO through the encoder of sets.

use crate::case::{Case, host};
use crate::update::check_step;
use burn::tensor::{Tensor, TensorData};
use playbot_learner::nn::{ActionBatch, Dist, tracked};
use playbot_learner::policy::{Actor, Critic, NetShape};
use playbot_learner::ppo::{Minibatch, PpoBatch, PpoNets, normalize_advantages};
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
        free: None,
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
        let (nets, batch) = (nets(&case, kind), minibatch(&case, kind));
        let x = nets.actor.join(&batch.inputs).expect("vectors");
        case.check("out.encoded", &host(x.clone()));
        let Dist::Categorical { log_probs } = nets.actor.forward(x.clone()) else { panic!("actions are discrete") };
        case.check("out.log_probs", &host(log_probs));
        case.check("out.values", &host(nets.critic.forward(x, None)));
        check_step(&case, nets, &batch, None);
    }
    case.finish(&[]);
}
