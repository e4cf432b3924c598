//! Variants of SAC: RLPD's ensemble of normalised critics, and the divergence from a prior in place of ln π (SPiRL).
//!
//! Expected numbers are those of `tests/fixtures/sac_variants`, whose losses are written down from the papers and whose
//! gradients are finite differences.

use crate::case::{Case, host};
use crate::update::check_gradients;
use burn::tensor::Tensor;
use playbot_learner::nn::{ActionBatch, Adam, AdamConfig, Dist, LayerNorm, Mlp, frozen, tracked};
use playbot_learner::policy::{Actor, NetShape};
use playbot_learner::rng::Streams;
use playbot_learner::sac::{
    Critics, LogTemperature, QNet, SacBatch, SacNets, actor_step, critic_step, target_of, temperature_step,
};
use playbot_learner::{ActionSpace, DeviceKind};

/// A case on a device.
struct Variant<'a> {
    case: &'a Case,
    kind: DeviceKind,
}

impl Variant<'_> {
    fn nets(&self) -> SacNets {
        let (case, device) = (self.case, self.kind.plain());
        let shape = NetShape {
            obs_dim: case.dim("obs"),
            latent: 0,
            hidden: case.hidden_layers("param.actor"),
            activation: case.activation(),
        };
        let range = (case.number("log_std_min"), case.number("log_std_max"));
        let mut rng = Streams::new(0).stream("nets", 0);
        let mut actor = Actor::squashed(&shape, ActionSpace::Continuous(case.dim("A")), range, &mut rng, &device);
        case.fill(&mut actor, "param.", "sac_actor", self.kind);
        SacNets {
            actor: tracked(&actor),
            critics: tracked(&self.critics("")),
            targets: frozen(&self.critics("targets")),
            log_temperature: tracked(&LogTemperature(case.tensor("param.log_alpha", &device))),
        }
    }

    fn critics(&self, prefix: &str) -> Critics {
        let (case, device) = (self.case, self.kind.plain());
        let (inputs, hidden) = (case.dim("obs") + case.dim("A"), case.hidden_layers("param.q1"));
        let mut rng = Streams::new(0).stream("nets", 0);
        let nets = (0..case.dim("critics")).map(|_| QNet {
            net: Mlp::new(inputs, &hidden, 1, case.activation(), 1.0, &mut rng, &device),
            norms: self.norms(&hidden),
        });
        let mut critics = Critics { nets: nets.collect() };
        case.fill(&mut critics, "param.", prefix, self.kind);
        critics
    }

    /// Returns the norms of hidden layers of these widths, if the case has any.
    fn norms(&self, widths: &[usize]) -> Vec<LayerNorm> {
        let device = self.kind.plain();
        let normalised = widths.iter().filter(|_| self.case.has("param.q1.l0.norm.scale"));
        let norm = |&width: &usize| LayerNorm {
            scale: Tensor::ones([width], &device),
            shift: Tensor::zeros([width], &device),
        };
        normalised.map(norm).collect()
    }

    fn batch(&self) -> SacBatch {
        let (case, device) = (self.case, self.kind.plain());
        let prior = |name: &str| Dist::Gaussian {
            mean: case.tensor(&format!("in.{name}_mean"), &device),
            log_std: case.tensor(&format!("in.{name}_log_std"), &device),
            free: None,
        };
        SacBatch {
            inputs: case.tensor("in.obs", &device),
            actions: ActionBatch::new(&case.actions("in.actions"), &device),
            rewards: case.tensor("in.rewards", &device),
            left: None,
            continues: case.tensor("in.continues", &device),
            next_inputs: case.tensor("in.next_obs", &device),
            teacher: None,
            seen_by_target: case.sizes("seen_by_target"),
            logit_offsets: None,
            entropy_share: 1.0,
            prior: case.has("in.prior_mean").then(|| (prior("prior"), prior("next_prior"))),
        }
    }

    fn check_critics(&self, nets: &mut SacNets, batch: &SacBatch, alpha: f64) {
        let (case, gamma) = (self.case, self.case.number("gamma"));
        let noise: Tensor<2> = case.tensor("in.noise_next", &self.kind.plain());
        let target = target_of(nets, batch, Some(&noise), alpha, gamma).expect("with noise");
        case.check("out.q_target", &host(target));
        for (i, q) in nets.critics.of_actions(batch.inputs.clone(), &batch.actions).into_iter().enumerate() {
            case.check(&format!("out.q{}", i + 1), &host(q));
        }
        let mut adam = still();
        let step = critic_step(nets, &mut adam, batch, Some(&noise), alpha, gamma, 0.0).expect("finite");
        for (i, loss) in step.losses.iter().enumerate() {
            case.check_number(&format!("q{}_loss", i + 1), *loss);
        }
        case.check_number("critic_loss", step.losses.iter().sum::<f64>());
        case.check_number("q_values", step.q_values);
        case.check_number("critic_grad_norm", step.grad_norm);
        check_gradients(case, "grad_critic.", ("", ""), &mut nets.critics, &adam);
    }

    fn check_actor(&self, nets: &mut SacNets, batch: &SacBatch, alpha: f64) {
        let case = self.case;
        let noise: Tensor<2> = case.tensor("in.noise_actor", &self.kind.plain());
        let mut adam = still();
        let step = actor_step(nets, &mut adam, batch, Some(&noise), alpha, None, 0.0).expect("finite");
        case.check_number("actor_loss", step.actor_loss);
        case.check_number("entropy", step.entropy);
        case.check_number("actor_grad_norm", step.grad_norm);
        check_gradients(case, "grad_actor.", ("actor", "sac_actor"), &mut nets.actor, &adam);
        if batch.prior.is_some() {
            case.check_number("prior_kl", step.decoder_kl);
            let (mut adam, target) = (still(), case.number("target_entropy"));
            let step = temperature_step(nets, &mut adam, batch, Some(&noise), target, 0.0).expect("finite");
            case.check_number("temperature_loss", step.temperature_loss);
            case.check_number("temperature_grad", f64::from(adam.moments("log_alpha").expect("updated").0[0]));
        }
    }
}

/// Returns an Adam that leaves the gradient in the first moment.
fn still() -> Adam {
    Adam::new(AdamConfig { beta1: 0.0, beta2: 0.0, ..AdamConfig::default() })
}

fn check(name: &str) {
    let case = Case::of_sac_variants(name);
    case.assert_fixed("eps_inside_log", 1e-6);
    case.assert_fixed("layer_norm_eps", 1e-6);
    for kind in DeviceKind::CPU {
        let variant = Variant { case: &case, kind };
        let (mut nets, batch) = (variant.nets(), variant.batch());
        let alpha = nets.temperature().expect("readable");
        case.check_number("temperature", alpha);
        variant.check_critics(&mut nets, &batch, alpha);
        variant.check_actor(&mut nets, &batch, alpha);
    }
    case.finish(&[]);
}

#[test]
fn golden_rlpd_step() {
    check("rlpd_step");
}

#[test]
fn golden_spirl_sac_step() {
    check("spirl_sac_step");
}
