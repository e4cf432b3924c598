//! A gradient step of PPO and of SCORE on several choices, on choices and numbers together, under masks, and where the
//! game holds an earlier action.

use crate::case::{Case, host};
use crate::update::check_step;
use burn::tensor::{Tensor, TensorData};
use playbot_learner::nn::{ActionBatch, Dist, tracked};
use playbot_learner::policy::{Actor, Critic, NetShape};
use playbot_learner::ppo::{Minibatch, PpoBatch, PpoNets, normalize_advantages};
use playbot_learner::rng::Streams;
use playbot_learner::score::{TeacherBatch, confidences};
use playbot_learner::{
    ActionSpace, Actions, Choices, ConfidenceKind, DeviceKind, KlDirection, MixedSpace, ScoreConfig, StdKind,
};

fn space(case: &Case) -> ActionSpace {
    match (&case.sizes("choices")[..], case.dim("numbers")) {
        (&[choices], 0) => ActionSpace::Discrete(choices),
        (&[], numbers) => ActionSpace::Continuous(numbers),
        (sizes, numbers) => {
            ActionSpace::Mixed(MixedSpace { choices: Choices::new(sizes).expect("few choices"), numbers })
        }
    }
}

fn actions(case: &Case, space: &ActionSpace) -> Actions {
    let options = case.f32s("in.options").into_iter().map(|option| option as u32).collect();
    match space {
        ActionSpace::Mixed(mixed) => Actions::Mixed {
            choices: mixed.choices.sizes().len(),
            options,
            dim: mixed.numbers,
            values: if mixed.numbers > 0 { case.f32s("in.numbers") } else { Vec::new() },
        },
        ActionSpace::Continuous(dim) => Actions::Continuous { dim: *dim, values: case.f32s("in.numbers") },
        ActionSpace::Discrete(_) => Actions::Discrete(options),
    }
}

/// Returns what is added to the logits: nothing where a choice has no legal option.
fn offsets(case: &Case, space: &ActionSpace, kind: DeviceKind) -> Option<Tensor<2>> {
    let legal = case.has("in.legal").then(|| case.bools("in.legal"))?;
    let rows = legal.chunks_exact(space.options()).flat_map(|legal| {
        let mut offsets = vec![0.0; legal.len()];
        for at in space.choices().ranges().filter(|at| legal[at.clone()].contains(&true)) {
            at.filter(|&option| !legal[option]).for_each(|option| offsets[option] = -1e8);
        }
        offsets
    });
    let rows: Vec<f32> = rows.collect();
    let shape = [rows.len() / space.options(), space.options()];
    Some(Tensor::from_data(TensorData::new(rows, shape), &kind.plain()))
}

fn check(name: &str) {
    let case = Case::of_action_spaces(name);
    let space = space(&case);
    for kind in DeviceKind::CPU {
        let device = kind.plain();
        let mut rng = Streams::new(0).stream("nets", 0);
        let shape = NetShape {
            obs_dim: case.dim("obs"),
            latent: 0,
            hidden: vec![case.dim("hidden")],
            activation: case.activation(),
        };
        let mut actor = Actor::new(&shape, space, StdKind::Vector, &mut rng, &device);
        let (mut decoder, mut critic) = (actor.clone(), Critic::new(&shape, &mut rng, &device));
        case.fill(&mut actor, "param.", "actor", kind);
        case.fill(&mut critic, "param.", "critic", kind);
        case.fill(&mut decoder, "in.", "frozen", kind);
        let nets = tracked(&PpoNets { actor, critic, intrinsic: None });

        let (x, actions) = (case.tensor::<2>("in.obs", &device), actions(&case, &space));
        let logit_offsets = offsets(&case, &space, kind);
        let free = case.has("in.free").then(|| case.tensor::<1>("in.free", &device));
        let of = |actor: &Actor| actor.forward_legal(x.clone(), logit_offsets.as_ref()).with_free(free.as_ref());
        let (policy, decoded) = (of(&nets.actor), of(&decoder));
        let taken = ActionBatch::new(&actions, &device);
        case.check("out.log_probs", &host(policy.log_prob(&taken).expect("same kind")));
        let rows = actions.len();
        let by_row = |numbers: Vec<f32>| if numbers.len() == 1 { numbers.repeat(rows) } else { numbers };
        case.check("out.entropy", &by_row(host(policy.entropy())));
        let lifted = |dist: &Dist| dist.clone().to_host().expect("readable");
        let constant = |dist: &Dist| lifted(dist).rows(&(0..rows).collect::<Vec<_>>(), &device);
        case.check("out.kl", &host(decoded.kl(&constant(&policy)).expect("same kind")));
        let confidence = confidences(ConfidenceKind::PolicyAction, &lifted(&decoded), &actions).expect("they fit");
        case.check("out.confidence", &confidence);

        let column = |name: &str| case.tensor::<1>(name, &device);
        let mut advantages = case.f32s("in.advantages");
        normalize_advantages(&mut advantages);
        let batch = Minibatch {
            inputs: x.clone().into(),
            augmented: None,
            recall: None,
            left: None,
            logit_offsets: logit_offsets.clone(),
            free: free.clone(),
            ppo: PpoBatch {
                actions: taken,
                old_log_probs: column("in.old_log_probs"),
                advantages: Tensor::from_floats(advantages.as_slice(), &device),
                old_values: column("in.old_values"),
                returns: column("in.returns"),
            },
            teacher: Some(TeacherBatch {
                dist: decoded,
                mean_confidence: 0.0,
                confidence: Tensor::from_floats(confidence.as_slice(), &device),
            }),
            intrinsic_returns: None,
        };
        let score = ScoreConfig {
            kl_coef: case.number("kl_coef"),
            kl_direction: KlDirection::DecoderPolicy,
            confidence: ConfidenceKind::PolicyAction,
            ..ScoreConfig::default()
        };
        check_step(&case, nets, &batch, Some(&score));
    }
    case.finish(&[]);
}

#[test]
fn golden_several_choices() {
    check("several_choices");
}

#[test]
fn golden_choices_and_numbers_under_masks() {
    check("mixed");
}

#[test]
fn golden_masked_choice() {
    check("masked_choice");
}

#[test]
fn golden_numbers_that_are_held() {
    check("held_numbers");
}

#[test]
fn golden_choices_and_numbers_that_are_held() {
    check("held_action");
}
