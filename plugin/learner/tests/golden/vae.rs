//! The skill model on state vectors: every intermediate result, the loss, and every gradient.

use crate::case::{Case, host, number};
use burn::tensor::{Tensor, TensorData};
use playbot_learner::nn::{ActionRows, Dist, NamedGrads, parameter_count, tracked};
use playbot_learner::rng::Streams;
use playbot_learner::skill::{SkillNets, skill_loss};
use playbot_learner::{ActionSpace, Actions, DeviceKind, Reduction, SkillConfig, StdKind};

fn config(case: &Case) -> SkillConfig {
    let hidden = case.dim("hidden");
    let std = if case.hyper("head") == "state" { StdKind::State } else { StdKind::Vector };
    SkillConfig {
        latent: case.dim("latent"),
        window: case.dim("T"),
        beta: case.number("beta"),
        hidden: vec![hidden; 2],
        encoder_hidden: hidden,
        gru_hidden: hidden,
        gru_layers: case.dim("layers"),
        tanh_latent: case.hyper("tanh_latent") == true,
        latent_reg: case.hyper("latent_reg").as_f64().unwrap_or(0.0),
        prior_std: std,
        decoder_std: std,
        reduction: if case.hyper("reduction") == "legacy" { Reduction::Legacy } else { Reduction::Standard },
        ..SkillConfig::default()
    }
}

/// `[B, T, width]` to time-major `[T * B, width]`.
fn time_major(values: &[f32], batch: usize, steps: usize) -> Vec<f32> {
    let width = values.len() / (batch * steps);
    let row = |t: usize, b: usize| &values[(b * steps + t) * width..(b * steps + t + 1) * width];
    (0..steps * batch).flat_map(|i| row(i / batch, i % batch).to_vec()).collect()
}

/// Time-major `[T * B, width]` back to `[B, T, width]`.
fn batch_major(values: &[f32], batch: usize, steps: usize) -> Vec<f32> {
    time_major(values, steps, batch)
}

struct Inputs {
    states: Vec<f32>,
    actions: Vec<f32>,
    eps: Vec<f32>,
}

fn run(case: &Case, mut nets: SkillNets, inputs: &Inputs, kind: DeviceKind) {
    let device = kind.plain();
    let config = config(case);
    let (batch, steps) = (case.dim("B"), case.dim("T"));
    let (obs, act) = (case.dim("obs"), case.dim("act"));
    nets = tracked(&nets);
    let matrix = |values: &[f32], rows: usize| -> Tensor<2> {
        Tensor::from_data(TensorData::new(values.to_vec(), [rows, values.len() / rows]), &device)
    };
    let states = time_major(&inputs.states, batch, steps);
    let actions = time_major(&inputs.actions, batch, steps);
    let first = matrix(&states[..batch * obs], batch);
    let states = matrix(&states, steps * batch);
    let encoded = matrix(&actions, steps * batch);
    let rows = ActionRows::new(&Actions::Continuous { dim: act, values: actions }, &device);
    let noise = matrix(&inputs.eps, batch);

    if let Dist::Gaussian { mean, log_std } = nets.encoder.forward(states.clone(), encoded.clone(), steps) {
        case.check("out.enc_mean", &host(mean.clone()));
        case.check("out.enc_log_std", &host(log_std.clone()));
        case.check("out.latent", &host(mean + noise.clone() * log_std.exp()));
    }
    let prior = nets.prior.forward(first.clone()).to_host().expect("readable");
    case.check("out.prior_mean", &prior.head);
    case.check("out.prior_log_std", &prior.log_std.expect("Gaussian"));
    let forward = nets.forward(states, first, &rows, encoded, noise, steps).expect("they fit");
    case.check("out.decoder_latent", &host(forward.decoder_latent.clone()));
    case.check("out.kl_per_sequence", &host(forward.kl_per_sequence.clone()));
    case.check("out.nll_per_step", &batch_major(&host(forward.nll_per_step.clone()), batch, steps));
    let decoded = forward.decoded.clone().to_host().expect("readable");
    case.check("out.dec_mean", &batch_major(&decoded.head, batch, steps));
    case.check("out.dec_log_std", &batch_major(&decoded.log_std.expect("Gaussian"), batch, steps));

    let loss = skill_loss(&forward, &config);
    case.check_number("nll", number(loss.nll));
    case.check_number("kl", number(loss.kl));
    case.check_number("total_loss", number(loss.total.clone()));
    if config.reduction == Reduction::Legacy {
        case.check_number("latent_norm", number(loss.latent_norm));
    }
    let grads = NamedGrads::read(&mut nets, "", &loss.total.backward()).expect("readable");
    for (name, values) in grads.iter() {
        case.check_parameter("grad.", name, values);
    }
    case.check_number("grad_norm.total", grads.norm());
}

fn check(name: &str) {
    let case = Case::load(name);
    let space = ActionSpace::Continuous(case.dim("act"));
    let inputs = Inputs { states: case.f32s("in.states"), actions: case.f32s("in.actions"), eps: case.f32s("in.eps") };
    for kind in DeviceKind::ALL {
        let mut nets = SkillNets::new(&config(&case), case.dim("obs"), space, &Streams::new(0), &kind.plain());
        case.fill(&mut nets, "param.", "", kind);
        if case.dim("hidden") == 200 {
            case.check_number("param_count.enc", parameter_count(&nets.encoder) as f64);
            case.check_number("param_count.dec", parameter_count(&nets.decoder) as f64);
            case.check_number("param_count.prior", parameter_count(&nets.prior) as f64);
        } else {
            case.check_number("param_count", parameter_count(&nets) as f64);
        }
        run(&case, nets, &inputs, kind);
    }
    // Single norms follow from the gradients; unclamped terms are not kept; the feature is an inner step.
    case.finish(&["grad_norm.", "nll_unclamped", "kl_unclamped", "out.enc_feature"]);
}

#[test]
fn golden_vae_state_tiny_tanh() {
    check("vae_state_tiny_tanh");
}

#[test]
fn golden_vae_state_tiny_plain() {
    check("vae_state_tiny_plain");
}

#[test]
fn golden_vae_state_tiny_state_heads() {
    check("vae_state_tiny_state_heads");
}

#[test]
fn golden_vae_state_tiny_legacy() {
    check("vae_state_tiny_legacy");
}

#[test]
fn golden_vae_state_tiny_legacy_saturated() {
    check("vae_state_tiny_legacy_saturated");
}

#[test]
fn golden_vae_state_deep_tanh() {
    check("vae_state_deep_tanh");
}

#[test]
fn golden_vae_paper_size() {
    check("vae_paper_size");
}
