//! A gradient step of PPO through sequences of different lengths.

use crate::case::{Case, host};
use crate::update::check_step;
use burn::tensor::{Tensor, TensorData};
use playbot_learner::nn::{ActionBatch, Dist, tracked};
use playbot_learner::policy::{Actor, Critic, MemoryKind, NetShape, Recall};
use playbot_learner::ppo::{Minibatch, PpoBatch, PpoNets, normalize_advantages};
use playbot_learner::rng::Streams;
use playbot_learner::{ActionSpace, Actions, DeviceKind, PolicySpec, PpoConfig, PpoLearner, StdKind};

const LENGTHS: [usize; 4] = [3, 1, 4, 2];

fn nets(case: &Case, kind: DeviceKind) -> PpoNets {
    let (obs_dim, memory) = (case.dim("obs"), case.dim("memory"));
    let space = ActionSpace::Discrete(case.dim("K"));
    let shape = NetShape {
        obs_dim: obs_dim + memory,
        latent: 0,
        hidden: vec![case.dim("hidden")],
        activation: case.activation(),
    };
    let (mut rng, device) = (Streams::new(0).stream("nets", 0), kind.plain());
    let kind_of_memory = MemoryKind::Gru { hidden: memory, sequence: 8, burn_in: 0 };
    let config = PpoConfig { memory: kind_of_memory, hidden: shape.hidden.clone(), ..PpoConfig::default() };
    let spec = PolicySpec { obs: obs_dim.into(), latent: 0, action_space: space };
    let learner = PpoLearner::new(config, spec, 1, kind).expect("good settings");
    let memory = learner.nets().actor.memory.clone();
    let mut actor = Actor { memory, ..Actor::new(&shape, space, StdKind::Vector, &mut rng, &device) };
    let mut critic = Critic::new(&shape, &mut rng, &device);
    case.fill(&mut actor, "param.", "actor", kind);
    case.fill(&mut critic, "param.", "critic", kind);
    tracked(&PpoNets { actor, critic, intrinsic: None })
}

fn minibatch(case: &Case, kind: DeviceKind) -> Minibatch {
    let device = kind.plain();
    let column = |name: &str| Tensor::<1>::from_floats(case.f32s(name).as_slice(), &device);
    let matrix = |name: &str| -> Tensor<2> {
        Tensor::from_data(TensorData::new(case.f32s(name), case.shape(name).to_vec()), &device)
    };
    let mut advantages = case.f32s("in.advantages");
    normalize_advantages(&mut advantages);
    let actions = Actions::Discrete(case.f32s("in.actions").into_iter().map(|a| a as u32).collect());
    Minibatch {
        inputs: matrix("in.obs").into(),
        augmented: None,
        recall: Some(Recall::new(matrix("in.initial"), &LENGTHS)),
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
fn golden_ppo_memory() {
    let case = Case::of_memory("ppo_memory");
    assert_eq!(case.f32s("in.obs").len(), LENGTHS.iter().sum::<usize>() * case.dim("obs"));
    for kind in DeviceKind::CPU {
        let (nets, batch) = (nets(&case, kind), minibatch(&case, kind));
        let x = nets.actor.join(&batch.inputs).expect("vectors");
        let x = nets.actor.recall(x, batch.recall.as_ref()).expect("vectors");
        let Dist::Categorical { log_probs } = nets.actor.forward(x.clone()) else { panic!("actions are discrete") };
        case.check("out.log_probs", &host(log_probs));
        case.check("out.values", &host(nets.critic.forward(x, None)));
        check_step(&case, nets, &batch, None);
    }
    case.finish(&[]);
}
