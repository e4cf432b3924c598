//! Whole updates: epochs of minibatches, with every loss, the weights after, and Adam's moments.

use crate::case::{Case, host};
use burn::tensor::{Tensor, TensorData};
use playbot_learner::nn::{ActionBatch, Adam, AdamConfig, ParamVisitor, Parameters, tracked};
use playbot_learner::policy::{Actor, Critic, NetShape};
use playbot_learner::ppo::{
    Minibatch, PpoBatch, PpoNets, StepMetrics, gradient_step, normalize_advantages, ratio_stats,
};
use playbot_learner::rng::Streams;
use playbot_learner::score::{TeacherBatch, confidences};
use playbot_learner::{ActionSpace, Actions, ConfidenceKind, DeviceKind, KlDirection, PpoConfig, ScoreConfig, StdKind};

fn check(name: &str) {
    let case = Case::load(name);
    case.assert_fixed("adv_eps", 1e-8);
    case.assert_fixed("adv_std", "unbiased");
    case.assert_fixed("actor_input", if case.has("in.skill") { "[skill, obs]" } else { "obs" });
    for kind in DeviceKind::CPU {
        Update::new(&case, kind).run();
    }
    case.finish(&[]);
}

struct Update<'a> {
    case: &'a Case,
    kind: DeviceKind,
    config: PpoConfig,
    score: Option<ScoreConfig>,
    nets: PpoNets,
    decoder: Option<Actor>,
}

impl<'a> Update<'a> {
    fn new(case: &'a Case, kind: DeviceKind) -> Self {
        let space = match case.actions("in.actions") {
            Actions::Discrete(_) => ActionSpace::Discrete(case.dim("K")),
            Actions::Continuous { .. } => ActionSpace::Continuous(case.dim("A")),
            Actions::Mixed { .. } => panic!("in `action_spaces`"),
        };
        let shape = NetShape {
            obs_dim: case.dim("obs"),
            latent: case.dim("skill"),
            hidden: case.hidden_layers("param.actor"),
            activation: case.activation(),
        };
        let mut rng = Streams::new(0).stream("nets", 0);
        let device = kind.plain();
        let mut actor = Actor::new(&shape, space, StdKind::Vector, &mut rng, &device);
        let mut critic = Critic::new(&shape, &mut rng, &device);
        case.fill(&mut actor, "param.", "actor", kind);
        case.fill(&mut critic, "param.", "critic", kind);
        let decoder = case.has("in.decoder.l0.weight").then(|| {
            let mut decoder = Actor::new(&shape, space, StdKind::Vector, &mut rng, &device);
            case.fill(&mut decoder, "in.", "frozen", kind);
            decoder
        });
        let score = decoder.is_some().then(|| ScoreConfig {
            kl_coef: case.number("kl_coef"),
            confidence: match case.hyper("alpha").as_str() {
                Some("off") => ConfidenceKind::Off,
                Some("score_own_sample" | "prob_own_sample") => ConfidenceKind::OwnSample,
                Some("score_policy_action" | "prob_policy_action") => ConfidenceKind::PolicyAction,
                Some("density_policy_action") => ConfidenceKind::Density,
                other => panic!("unknown alpha {other:?}"),
            },
            kl_direction: match case.hyper("kl_direction").as_str() {
                Some("decoder||policy") => KlDirection::DecoderPolicy,
                Some("policy||decoder") => KlDirection::PolicyDecoder,
                other => panic!("unknown kl_direction {other:?}"),
            },
            ..ScoreConfig::default()
        });
        let config = PpoConfig {
            clip: case.number("clip"),
            vf_coef: case.number("vf_coef"),
            ent_coef: case.number("ent_coef"),
            max_grad_norm: case.number("max_grad_norm"),
            adam_eps: case.number("adam_eps"),
            ..PpoConfig::default()
        };
        Self { case, kind, config, score, nets: tracked(&PpoNets { actor, critic, intrinsic: None }), decoder }
    }

    fn run(mut self) {
        let case = self.case;
        let adam = AdamConfig {
            beta1: case.number("adam_beta1"),
            beta2: case.number("adam_beta2"),
            eps: self.config.adam_eps,
            ..AdamConfig::default()
        };
        let mut adam = Adam::new(adam);
        let (size, count) = (case.dim("minibatch"), case.number("minibatches") as usize);
        let permutations = case.indices("in.permutations");
        let epochs = permutations.chunks_exact(case.shape("in.permutations")[1]);
        let minibatches: Vec<&[usize]> = epochs.flat_map(|epoch| epoch.chunks(size).take(count)).collect();
        assert_eq!(case.expected("grad_norm").as_array().map(Vec::len), Some(minibatches.len()));
        for (i, &rows) in minibatches.iter().enumerate() {
            let batch = self.minibatch(rows);
            if i == 0 {
                check_first_gradients(case, self.nets.clone(), &batch, &self.config, self.score.as_ref());
            }
            let lr = case.number("lr");
            let (config, score) = (&self.config, self.score.as_ref());
            case.check_entry("old_approx_kl", i, self.old_approx_kl(&batch));
            let step = gradient_step(&mut self.nets, &mut adam, &batch, config, score, lr);
            self.check_step(i, &step.expect("finite"));
        }
        self.nets.visit("", &mut After(case));
        let mut names = Names(Vec::new());
        self.nets.visit("", &mut names);
        for name in names.0 {
            let (m, v) = adam.moments(&name).expect("updated");
            case.check_parameter("adam_m.", &name, m);
            case.check_parameter("adam_v.", &name, v);
        }
    }

    fn minibatch(&self, rows: &[usize]) -> Minibatch {
        let (case, device) = (self.case, self.kind.plain());
        let pick = |name: &str| -> Vec<f32> {
            let values = case.f32s(name);
            let width = values.len() / case.shape(name)[0];
            rows.iter().flat_map(|&r| values[r * width..(r + 1) * width].to_vec()).collect()
        };
        let matrix = |values: Vec<f32>| -> Tensor<2> {
            let width = values.len() / rows.len();
            Tensor::from_data(TensorData::new(values, [rows.len(), width]), &device)
        };
        let vector = |values: Vec<f32>| Tensor::<1>::from_floats(values.as_slice(), &device);
        let actions = |name: &str| match case.actions(name) {
            Actions::Discrete(all) => Actions::Discrete(rows.iter().map(|&r| all[r]).collect()),
            Actions::Continuous { dim, .. } => Actions::Continuous { dim, values: pick(name) },
            Actions::Mixed { .. } => panic!("in `action_spaces`"),
        };
        let mut inputs = matrix(pick("in.obs"));
        if case.has("in.skill") {
            inputs = Tensor::cat(vec![matrix(pick("in.skill")), inputs], 1);
        }
        let mut advantages = pick("in.advantages");
        normalize_advantages(&mut advantages);
        let teacher = self.decoder.as_ref().zip(self.score.as_ref()).map(|(decoder, score)| {
            let dist = decoder.forward(inputs.clone());
            let actions = match score.confidence {
                ConfidenceKind::OwnSample => actions("in.decoder_action"),
                _ => actions("in.actions"),
            };
            let host = dist.clone().to_host().expect("readable");
            let confidence = confidences(score.confidence, &host, &actions).expect("they fit");
            let sum: f64 = confidence.iter().map(|&x| f64::from(x)).sum();
            TeacherBatch { dist, mean_confidence: sum / confidence.len() as f64, confidence: vector(confidence) }
        });
        Minibatch {
            inputs: inputs.into(),
            augmented: None,
            recall: None,
            left: None,
            logit_offsets: None,
            free: None,
            ppo: PpoBatch {
                actions: ActionBatch::new(&actions("in.actions"), &device),
                old_log_probs: vector(pick("in.old_log_probs")),
                advantages: vector(advantages),
                old_values: vector(pick("in.old_values")),
                returns: vector(pick("in.returns")),
            },
            teacher,
            intrinsic_returns: None,
        }
    }

    fn old_approx_kl(&self, batch: &Minibatch) -> f64 {
        let dist = self.nets.actor.forward(self.nets.actor.join(&batch.inputs).expect("vectors"));
        let log_probs = dist.log_prob(&batch.ppo.actions).expect("same kind").inner();
        ratio_stats(&host(log_probs - batch.ppo.old_log_probs.clone()), self.config.clip).old_approx_kl
    }

    fn check_step(&self, i: usize, step: &StepMetrics) {
        let mut entries = numbers(step).to_vec();
        if self.score.is_some() {
            entries.push(("kl_mean", step.decoder_kl));
            entries.push(("kl_reg", step.kl_penalty));
            entries.push(("alpha_mean", step.confidence));
        }
        for (name, got) in entries {
            self.case.check_entry(name, i, got);
        }
    }
}

/// Returns the numbers of a step by their names in a case.
fn numbers(step: &StepMetrics) -> [(&'static str, f64); 7] {
    [
        ("policy_loss", step.policy_loss),
        ("value_loss", step.value_loss),
        ("entropy", step.entropy),
        ("total_loss", step.total_loss),
        ("approx_kl", step.approx_kl),
        ("clip_fraction", step.clip_fraction),
        ("grad_norm", step.grad_norm),
    ]
}

/// Does the step of a case with its settings, and compares gradients, losses and the weights after it.
pub fn check_step(case: &Case, mut nets: PpoNets, batch: &Minibatch, score: Option<&ScoreConfig>) {
    let config = PpoConfig {
        clip: case.number("clip"),
        vf_coef: case.number("vf_coef"),
        ent_coef: case.number("ent_coef"),
        max_grad_norm: case.number("max_grad_norm"),
        ..PpoConfig::default()
    };
    check_first_gradients(case, nets.clone(), batch, &config, score);
    let mut adam = Adam::new(AdamConfig { eps: case.number("adam_eps"), ..AdamConfig::default() });
    let step = gradient_step(&mut nets, &mut adam, batch, &config, score, case.number("lr")).expect("finite");
    let of_penalty = [("decoder_kl", step.decoder_kl), ("kl_penalty", step.kl_penalty)];
    for (name, got) in numbers(&step).into_iter().chain(of_penalty) {
        if case.expects(name) {
            case.check_number(name, got);
        }
    }
    nets.visit("", &mut After(case));
}

/// Compares the unclipped gradients: a step with learning rate 0 and β = 0 leaves them in Adam's first moment.
fn check_first_gradients(
    case: &Case,
    mut nets: PpoNets,
    batch: &Minibatch,
    config: &PpoConfig,
    score: Option<&ScoreConfig>,
) {
    let mut adam = Adam::new(AdamConfig { beta1: 0.0, beta2: 0.0, ..AdamConfig::default() });
    let config = PpoConfig { max_grad_norm: 1e30, ..config.clone() };
    gradient_step(&mut nets, &mut adam, batch, &config, score, 0.0).expect("finite");
    check_gradients(case, "step1_grad.", ("", ""), &mut nets, &adam);
}

/// Compares the gradients that a step with learning rate 0 and β = 0 left in Adam's first moment. Names that begin
/// with the first of two prefixes in `network` begin with the second in the case.
pub fn check_gradients<M: Parameters>(
    case: &Case,
    group: &str,
    (ours, theirs): (&str, &str),
    network: &mut M,
    adam: &Adam,
) {
    let mut names = Names(Vec::new());
    network.visit(ours, &mut names);
    for name in names.0 {
        let (gradient, _) = adam.moments(&name).expect("updated");
        case.check_parameter(group, &name.replacen(ours, theirs, 1), gradient);
    }
}

pub struct After<'a>(pub &'a Case);

impl ParamVisitor for After<'_> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        self.0.check_parameter("after.", name, &host(tensor.clone().inner()));
    }
}

pub struct Names(pub Vec<String>);

impl ParamVisitor for Names {
    fn visit<const D: usize>(&mut self, name: &str, _: &mut Tensor<D>) {
        self.0.push(name.to_owned());
    }
}

#[test]
fn golden_ppo_update_gaussian() {
    check("ppo_update_gaussian");
}

#[test]
fn golden_ppo_update_categorical() {
    check("ppo_update_categorical");
}

#[test]
fn golden_score_update_gaussian_score() {
    check("score_update_gaussian_score");
}

#[test]
fn golden_score_update_categorical_own_sample() {
    check("score_update_categorical_own_sample");
}

#[test]
fn golden_score_update_categorical_policy_action() {
    check("score_update_categorical_policy_action");
}

#[test]
fn an_exact_copy_of_the_decoder_pays_nothing() {
    let case = Case::load("score_update_categorical_own_sample");
    for kind in DeviceKind::CPU {
        let mut update = Update::new(&case, kind);
        let decoder = update.decoder.clone().expect("a SCORE case");
        update.nets.actor = decoder;
        update.nets = tracked(&update.nets);
        let batch = update.minibatch(&(0..case.dim("minibatch")).collect::<Vec<_>>());
        let mut adam = Adam::new(AdamConfig::default());
        let (config, score) = (&update.config, update.score.as_ref());
        let step = gradient_step(&mut update.nets, &mut adam, &batch, config, score, 1e-3);
        assert_eq!(step.expect("finite").decoder_kl, 0.0);
    }
}
