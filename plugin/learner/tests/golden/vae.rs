//! The skill model on state vectors and on images: every intermediate result, the loss, and every gradient.

use crate::case::{Case, host, norm, number};
use burn::tensor::{Tensor, TensorData};
use playbot_learner::nn::{ActionBatch, Activation, CnnKind, Dist, NamedGrads, ObsBatch, parameter_count, tracked};
use playbot_learner::rng::Streams;
use playbot_learner::skill::{SkillForward, SkillNets, skill_loss};
use playbot_learner::{
    ActionInput, ActionSpace, Actions, DeviceKind, ImageShape, ObsKind, Reduction, SkillConfig, StdKind,
};

fn is_image(case: &Case) -> bool {
    case.has("in.images")
}

fn observation(case: &Case) -> ObsKind {
    if !is_image(case) {
        return ObsKind::Vector(case.dim("obs"));
    }
    let [channels, height, width] = case.sizes("image")[..] else { panic!("an image has three sizes") };
    ObsKind::Image(ImageShape { channels, height, width })
}

/// Checks the fixed behaviour of the skill model.
fn check_fixed(case: &Case) {
    if !case.hyper("activation").is_null() {
        assert_eq!(case.activation(), Activation::Relu, "{}: the library's skill model knows only ReLU", case.name);
    }
    case.assert_fixed("legacy_clamp", 100.0);
    case.assert_fixed("log_std_clamp", vec![-10.0, 2.0]);
    if is_image(case) {
        case.assert_fixed("action_scale", 1.0 / (case.dim("K") - 1) as f64);
    }
}

fn config(case: &Case) -> SkillConfig {
    let hidden = case.dim("hidden");
    let std = match case.hyper("head").as_str() {
        Some("state") => StdKind::State,
        Some("vector") => StdKind::Vector,
        None if is_image(case) => StdKind::Vector,
        other => panic!("{}: unknown head {other:?}", case.name),
    };
    SkillConfig {
        latent: case.dim("latent"),
        window: case.dim("T"),
        beta: case.number("beta"),
        hidden: case.hidden_layers("param.dec"),
        encoder_hidden: hidden,
        gru_hidden: hidden,
        gru_layers: case.dim("layers"),
        tanh_latent: case.hyper("tanh_latent") == true,
        latent_reg: case.hyper("latent_reg").as_f64().unwrap_or(0.0),
        prior_std: std,
        decoder_std: std,
        cnn: if is_image(case) {
            CnnKind::Impala { channels: case.sizes("channels"), feature: case.dim("feat") }
        } else {
            CnnKind::default()
        },
        action_input: ActionInput::ScaledIndex,
        reduction: match case.hyper("reduction").as_str() {
            Some("legacy") => Reduction::Legacy,
            Some("standard") => Reduction::Standard,
            other => panic!("{}: unknown reduction {other:?}", case.name),
        },
        ..SkillConfig::default()
    }
}

/// Maps `[B, T, width]` to time-major `[T * B, width]`.
fn time_major<T: Copy>(values: &[T], batch: usize, steps: usize) -> Vec<T> {
    let width = values.len() / (batch * steps);
    let row = |t: usize, b: usize| &values[(b * steps + t) * width..(b * steps + t + 1) * width];
    (0..steps * batch).flat_map(|i| row(i / batch, i % batch).to_vec()).collect()
}

/// Maps time-major `[T * B, width]` back to `[B, T, width]`.
fn batch_major(values: &[f32], batch: usize, steps: usize) -> Vec<f32> {
    time_major(values, steps, batch)
}

/// One case on one device.
struct Run<'a> {
    case: &'a Case,
    config: SkillConfig,
    kind: DeviceKind,
    nets: SkillNets,
    space: ActionSpace,
    batch: usize,
    steps: usize,
}

impl<'a> Run<'a> {
    fn new(case: &'a Case, kind: DeviceKind) -> Self {
        let config = config(case);
        let space = match is_image(case) {
            true => ActionSpace::Discrete(case.dim("K")),
            false => ActionSpace::Continuous(case.dim("act")),
        };
        let mut nets =
            SkillNets::new(&config, observation(case), space, &Streams::new(0), &kind.plain()).expect("they fit");
        case.fill(&mut nets, "param.", "", kind);
        Self { case, config, kind, nets: tracked(&nets), space, batch: case.dim("B"), steps: case.dim("T") }
    }

    fn matrix(&self, values: &[f32], rows: usize) -> Tensor<2> {
        Tensor::from_data(TensorData::new(values.to_vec(), [rows, values.len() / rows]), &self.kind.plain())
    }

    fn states(&self) -> ObsBatch {
        let (case, rows) = (self.case, self.steps * self.batch);
        match observation(case) {
            ObsKind::Vector(_) => {
                ObsBatch::Vector(self.matrix(&time_major(&case.f32s("in.states"), self.batch, self.steps), rows))
            }
            ObsKind::Image(ImageShape { channels, height, width }) => {
                let pixels = time_major(&case.bytes("in.images"), self.batch, self.steps);
                ObsBatch::pixels(pixels, [rows, channels, height, width], &self.kind.plain())
            }
        }
    }

    /// Returns the actions, time-major.
    fn actions(&self) -> Actions {
        match self.space {
            ActionSpace::Discrete(_) => {
                let all: Vec<u32> = self.case.indices("in.actions").into_iter().map(|a| a as u32).collect();
                Actions::Discrete(time_major(&all, self.batch, self.steps))
            }
            ActionSpace::Continuous(dim) => {
                let values = time_major(&self.case.f32s("in.actions"), self.batch, self.steps);
                Actions::Continuous { dim, values }
            }
            ActionSpace::Mixed(_) => panic!("no case has several choices"),
        }
    }

    fn run(mut self) {
        let (case, steps) = (self.case, self.steps);
        let (states, actions) = (self.states(), self.actions());
        let encoded = self.config.action_input.encode(&actions, self.space).expect("actions of the space");
        let encoded = self.matrix(&encoded, steps * self.batch);
        let noise = self.matrix(&case.f32s("in.eps"), self.batch);
        self.check_inner(&states, &encoded, &noise);

        let rows = ActionBatch::new(&actions, &self.kind.plain());
        let forward = self.nets.forward(&states, &rows, encoded, noise, steps).expect("they fit");
        self.check_forward(&states, &forward);
        let loss = skill_loss(&forward, &self.config);
        case.check_number("nll", number(loss.nll));
        case.check_number("kl", number(loss.kl));
        case.check_number("total_loss", number(loss.total.clone()));
        if self.config.reduction == Reduction::Legacy {
            case.check_number("latent_norm", number(loss.latent_norm));
            case.check_number("nll_unclamped", number(forward.nll_per_step.mean()));
            case.check_number("kl_unclamped", number(forward.kl_per_sequence.sum()));
        }
        let grads = NamedGrads::read(&mut self.nets, "", &loss.total.backward()).expect("readable");
        self.check_gradients(&grads);
    }

    /// Checks the intermediate results of the networks.
    fn check_inner(&self, states: &ObsBatch, encoded: &Tensor<2>, noise: &Tensor<2>) {
        let (case, nets) = (self.case, &self.nets);
        if case.has("out.enc_feature") {
            let summary = nets.encoder.summary(states, encoded.clone(), self.steps).expect("they fit");
            case.check("out.enc_feature", &host(summary));
        }
        let posterior = nets.encoder.forward(states, encoded.clone(), self.steps).expect("they fit");
        if let Dist::Gaussian { mean, log_std, .. } = posterior {
            case.check("out.enc_mean", &host(mean.clone()));
            case.check("out.enc_log_std", &host(log_std.clone()));
            case.check("out.latent", &host(mean + noise.clone() * log_std.exp()));
        }
        let seen = nets.prior.observe(&states.first(self.batch)).expect("they fit");
        if is_image(case) {
            let batch_major = |x: Tensor<2>| batch_major(&host(x), self.batch, self.steps);
            case.check("out.prior_image_features", &host(seen.clone()));
            let features = nets.encoder.state.forward(states).expect("they fit");
            case.check("out.enc_image_features", &batch_major(features));
            case.check("out.dec_image_features", &batch_major(nets.decoder.observe(states).expect("they fit")));
        }
        let prior = nets.prior.forward(seen).to_host().expect("readable");
        case.check("out.prior_mean", &prior.head);
        case.check("out.prior_log_std", &prior.log_std.expect("Gaussian"));
    }

    fn check_forward(&self, states: &ObsBatch, forward: &SkillForward) {
        let case = self.case;
        let batch_major = |values: &[f32]| batch_major(values, self.batch, self.steps);
        case.check("out.decoder_latent", &host(forward.decoder_latent.clone()));
        case.check("out.kl_per_sequence", &host(forward.kl_per_sequence.clone()));
        case.check("out.nll_per_step", &batch_major(&host(forward.nll_per_step.clone())));
        let decoded = forward.decoded.clone().to_host().expect("readable");
        if let Some(log_std) = decoded.log_std {
            case.check("out.dec_mean", &batch_major(&decoded.head));
            case.check("out.dec_log_std", &batch_major(&log_std));
            return;
        }
        // The decoder normalises its logits at once; these are the logits.
        let (net, seen) = (&self.nets.decoder.net, self.nets.decoder.observe(states).expect("they fit"));
        let hidden = net.features_held(forward.decoder_latent.clone(), seen, self.steps);
        case.check("out.logits", &batch_major(&host(net.head.forward(hidden))));
    }

    fn check_gradients(&self, grads: &NamedGrads) {
        let case = self.case;
        for (name, values) in grads.iter() {
            case.check_parameter("grad.", name, values);
            case.check_norm("grad_norm.", name, values);
        }
        case.check_number("grad_norm.total", grads.norm());
        if is_paper_size(case) {
            for (theirs, ours) in [("enc", "encoder."), ("dec", "decoder."), ("prior", "prior.")] {
                let part = grads.iter().filter(|(name, _)| name.starts_with(ours));
                let squares: f64 = part.map(|(_, values)| norm(values).powi(2)).sum();
                case.check_number(&format!("grad_norm.{theirs}"), squares.sqrt());
            }
        }
    }
}

/// Returns whether the case gives sizes and norms of each network, and not of every tensor.
fn is_paper_size(case: &Case) -> bool {
    case.expects("param_count.enc")
}

fn check(name: &str) {
    let case = Case::load(name);
    check_fixed(&case);
    for kind in DeviceKind::CPU {
        let run = Run::new(&case, kind);
        if is_paper_size(&case) {
            case.check_number("param_count.enc", parameter_count(&run.nets.encoder) as f64);
            case.check_number("param_count.dec", parameter_count(&run.nets.decoder) as f64);
            case.check_number("param_count.prior", parameter_count(&run.nets.prior) as f64);
        } else {
            case.check_number("param_count", parameter_count(&run.nets) as f64);
        }
        run.run();
    }
    case.finish(&[]);
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

#[test]
fn golden_vae_image_small() {
    check("vae_image_small");
}

#[test]
fn golden_vae_image_small_legacy() {
    check("vae_image_small_legacy");
}
