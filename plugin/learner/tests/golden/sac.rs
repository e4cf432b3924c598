//! SAC: the squashed Gaussian, a whole continuous step, and the losses over choices.

use crate::case::{Case, host, number};
use crate::update::{After, check_gradients};
use burn::tensor::Tensor;
use playbot_learner::nn::{
    ActionBatch, Adam, AdamConfig, Dist, LogProbForm, Parameters, SquashedGaussian, bounded_log_std, frozen, tracked,
};
use playbot_learner::policy::{Actor, NetShape};
use playbot_learner::rng::Streams;
use playbot_learner::sac::{
    Critics, LogTemperature, SacBatch, SacNets, actor_step, critic_loss, critic_step, critics::soft_update, q_target,
    soft_value_of_choices, target_of, temperature_loss, temperature_step,
};
use playbot_learner::{ActionSpace, DeviceKind, EntropyCoef, SacConfig};

fn leaf<const D: usize>(tensor: Tensor<D>) -> Tensor<D> {
    tensor.autodiff().require_grad()
}

#[test]
fn golden_sac_logprob() {
    let case = Case::load("sac_logprob");
    case.assert_fixed("eps_inside_log", 1e-6);
    let list = |name: &str| -> Vec<f32> {
        let list = case.hyper(name).as_array().expect("a list");
        list.iter().map(|x| x.as_f64().expect("a number") as f32).collect()
    };
    let (low, high) = (list("action_low"), list("action_high"));
    let half = |sign: f32| -> Vec<f32> { low.iter().zip(&high).map(|(l, h)| 0.5 * (h + sign * l)).collect() };
    let range = (case.number("log_std_min"), case.number("log_std_max"));
    for kind in DeviceKind::CPU {
        let device = kind.plain();
        let row = |values: Vec<f32>| Tensor::<1>::from_floats(values.as_slice(), &device).unsqueeze();
        for (form, suffix) in [(LogProbForm::Eps, ""), (LogProbForm::Exact, "_exact")] {
            // One graph for each backward pass.
            let (mean, raw) =
                (leaf(case.tensor("param.mean", &device)), leaf(case.tensor("param.raw_log_std", &device)));
            let policy = SquashedGaussian {
                mean: mean.clone(),
                log_std: bounded_log_std(raw.clone(), range),
                scale: row(half(-1.0)),
                bias: row(half(1.0)),
            };
            let draw = policy.draw(case.tensor("in.noise", &device), form);
            case.check("out.log_std", &host(policy.log_std.clone()));
            case.check("out.pre_tanh", &host(draw.pre_tanh));
            case.check("out.action", &host(draw.action));
            let at_the_mean = policy.draw(policy.mean.zeros_like(), form);
            case.check("out.deterministic_action", &host(at_the_mean.action));
            case.check(&format!("out.log_prob{suffix}"), &host(draw.log_prob.clone()));
            let total = draw.log_prob.mean();
            case.check_number(&format!("mean_log_prob{suffix}"), number(total.clone()));
            let grads = total.backward();
            for (name, leaf) in [("mean", mean), ("raw_log_std", raw)] {
                let gradient = host(leaf.grad(&grads).expect("tracked"));
                case.check(&format!("grad.mean_log_prob{suffix}.{name}"), &gradient);
            }
        }
    }
    case.finish(&[]);
}

/// Settings of the continuous case.
struct Continuous {
    case: Case,
    kind: DeviceKind,
}

impl Continuous {
    fn nets(&self) -> SacNets {
        let (case, kind, device) = (&self.case, self.kind, self.kind.plain());
        let shape = NetShape {
            obs_dim: case.dim("obs"),
            latent: 0,
            hidden: case.hidden_layers("param.actor"),
            activation: case.activation(),
        };
        let space = ActionSpace::Continuous(case.dim("A"));
        let range = (case.number("log_std_min"), case.number("log_std_max"));
        let mut rng = Streams::new(0).stream("nets", 0);
        let mut actor = Actor::squashed(&shape, space, range, &mut rng, &device);
        case.fill(&mut actor, "param.", "sac_actor", kind);
        let mut critics = Critics::new(&shape, space, &mut rng, &device);
        case.fill(&mut critics, "param.", "", kind);
        let mut targets = Critics::new(&shape, space, &mut rng, &device);
        case.fill(&mut targets, "param.", "target", kind);
        let log_temperature = LogTemperature(case.tensor("param.log_alpha", &device));
        SacNets {
            actor: tracked(&actor),
            critics: tracked(&critics),
            targets: frozen(&targets),
            log_temperature: tracked(&log_temperature),
        }
    }

    fn batch(&self) -> SacBatch {
        let (case, device) = (&self.case, self.kind.plain());
        SacBatch {
            inputs: case.tensor("in.obs", &device),
            actions: ActionBatch::new(&case.actions("in.actions"), &device),
            rewards: case.tensor("in.rewards", &device),
            continues: case.tensor::<1>("in.terminations", &device).neg() + 1.0,
            next_inputs: case.tensor("in.next_obs", &device),
            left: None,
            teacher: None,
            prior: None,
            seen_by_target: Vec::new(),
            logit_offsets: None,
            entropy_share: 1.0,
        }
    }

    fn noise(&self, name: &str) -> Tensor<2> {
        self.case.tensor(name, &self.kind.plain())
    }

    /// Checks the policy's outputs for the next states, and the critics' for the batch, before anything is trained.
    fn check_values(&self, nets: &SacNets, batch: &SacBatch, alpha: f64) {
        let (case, device) = (&self.case, self.kind.plain());
        let Dist::Gaussian { mean, log_std, .. } = nets.actor.forward(batch.next_inputs.clone()) else {
            panic!("continuous")
        };
        let draw = SquashedGaussian::unit(mean, log_std, &device).draw(self.noise("in.noise_next"), LogProbForm::Eps);
        case.check("out.next_action", &host(draw.action));
        case.check("out.next_log_prob", &host(draw.log_prob));
        let q = nets.critics.of_actions(batch.inputs.clone(), &batch.actions);
        case.check("out.q1", &host(q[0].clone()));
        case.check("out.q2", &host(q[1].clone()));
        let noise = self.noise("in.noise_next");
        let target = target_of(nets, batch, Some(&noise), alpha, case.number("gamma")).expect("with noise");
        case.check("out.q_target", &host(target));
    }

    fn run(&self) {
        let case = &self.case;
        let (mut nets, batch) = (self.nets(), self.batch());
        let config = AdamConfig {
            beta1: case.number("adam_beta1"),
            beta2: case.number("adam_beta2"),
            eps: case.number("adam_eps"),
            ..AdamConfig::default()
        };
        let still = AdamConfig { beta1: 0.0, beta2: 0.0, ..config };
        let alpha = nets.temperature().expect("readable");
        case.check_number("alpha_before", alpha);
        self.check_values(&nets, &batch, alpha);

        let (noise, gamma) = (self.noise("in.noise_next"), case.number("gamma"));
        let (mut copy, mut adam) = (nets.clone(), Adam::new(still));
        critic_step(&mut copy, &mut adam, &batch, Some(&noise), alpha, gamma, 0.0).expect("finite");
        check_gradients(case, "grad_critic.", ("", ""), &mut copy.critics, &adam);
        let mut adam = Adam::new(config);
        let lr = case.number("q_lr");
        let step = critic_step(&mut nets, &mut adam, &batch, Some(&noise), alpha, gamma, lr).expect("finite");
        case.check_number("q1_loss", step.losses[0]);
        case.check_number("q2_loss", step.losses[1]);
        case.check_number("critic_loss", step.losses.iter().sum::<f64>());
        case.check_number("critic_grad_norm", step.grad_norm);

        let noise = self.noise("in.noise_actor");
        let (mut copy, mut adam) = (nets.clone(), Adam::new(still));
        actor_step(&mut copy, &mut adam, &batch, Some(&noise), alpha, None, 0.0).expect("finite");
        check_gradients(case, "grad_actor.", ("actor", "sac_actor"), &mut copy.actor, &adam);
        let mut adam = Adam::new(config);
        let lr = case.number("actor_lr");
        let step = actor_step(&mut nets, &mut adam, &batch, Some(&noise), alpha, None, lr).expect("finite");
        case.check_number("actor_loss", step.actor_loss);
        case.check_number("actor_grad_norm", step.grad_norm);
        case.check_number("mean_log_prob_actor", -step.entropy);
        // The loss is alpha · mean(ln π) - mean(min Q).
        case.check_number("mean_min_q_actor", -alpha * step.entropy - step.actor_loss);

        let (noise, target) = (self.noise("in.noise_alpha"), case.number("target_entropy"));
        let dim = case.dim("A");
        let entropy = EntropyCoef::Auto { initial: 1.0, target_scale: Some(-target / dim as f64) };
        let settings = SacConfig { entropy, ..SacConfig::default() };
        let set = settings.target_entropy(ActionSpace::Continuous(dim)).expect("tuned");
        assert!((set - target).abs() < 1e-12, "{set}, not {target}");
        let (mut copy, mut adam) = (nets.clone(), Adam::new(still));
        temperature_step(&mut copy, &mut adam, &batch, Some(&noise), target, 0.0).expect("finite");
        case.check_number("alpha_grad", f64::from(adam.moments("log_alpha").expect("updated").0[0]));
        let mut adam = Adam::new(config);
        let step = temperature_step(&mut nets, &mut adam, &batch, Some(&noise), target, case.number("alpha_lr"))
            .expect("finite");
        case.check_number("alpha_loss", step.temperature_loss);
        case.check_number("mean_log_prob_alpha", step.log_prob);
        case.check_number("alpha_loss_log_form", -alpha.ln() * (step.log_prob + target));
        case.check_number("alpha_after", nets.temperature().expect("readable"));

        soft_update(&mut nets.targets, &nets.critics, case.number("tau"));
        nets.actor.visit("sac_actor", &mut After(case));
        nets.critics.visit("", &mut After(case));
        nets.targets.visit("target", &mut After(case));
        nets.log_temperature.visit("", &mut After(case));
    }
}

#[test]
fn golden_sac_update_continuous() {
    let mut case = Case::load("sac_update_continuous");
    case.assert_fixed("action_scale", 1.0);
    case.assert_fixed("action_bias", 0.0);
    case.assert_fixed("eps_inside_log", 1e-6);
    case.assert_fixed("critic_input", "[obs, action]");
    for kind in DeviceKind::CPU {
        let update = Continuous { case, kind };
        update.run();
        case = update.case;
    }
    case.finish(&[]);
}

#[test]
fn the_default_target_entropy_is_minus_the_number_of_dimensions() {
    let entropy = EntropyCoef::Auto { initial: 1.0, target_scale: None };
    let settings = SacConfig { entropy, ..SacConfig::default() };
    assert_eq!(settings.target_entropy(ActionSpace::Continuous(3)), Some(-3.0));
}

#[test]
fn golden_sac_discrete_losses() {
    let case = Case::load("sac_discrete_losses");
    let choices = case.dim("K") as f64;
    let target_scale = Some(case.number("target_entropy_scale"));
    let settings = SacConfig { entropy: EntropyCoef::Auto { initial: 1.0, target_scale }, ..SacConfig::default() };
    let target_entropy = settings.target_entropy(ActionSpace::Discrete(case.dim("K"))).expect("tuned");
    assert!((target_entropy - case.number("target_entropy")).abs() < 1e-12);
    for kind in DeviceKind::CPU {
        let device = kind.plain();
        let log_probs = |logits: Tensor<2>| match Dist::categorical(logits) {
            Dist::Categorical { log_probs } => log_probs,
            Dist::Gaussian { .. } | Dist::Joint(_) => panic!("categorical"),
        };
        let log_alpha = leaf(case.tensor::<1>("param.log_alpha", &device));
        let alpha = number(log_alpha.clone().exp());
        case.check_number("alpha", alpha);

        let next = soft_value_of_choices(
            log_probs(case.tensor("in.next_logits", &device)),
            case.tensor::<2>("in.next_q1_target", &device).min_pair(case.tensor("in.next_q2_target", &device)),
            alpha,
        );
        case.check("out.next_value", &host(next.clone()));
        let continues = case.tensor::<1>("in.terminations", &device).neg() + 1.0;
        let target = q_target(case.tensor("in.rewards", &device), continues, next, case.number("gamma"));
        case.check("out.q_target", &host(target.clone()));

        let (q1, q2) = (leaf(case.tensor("param.q1", &device)), leaf(case.tensor("param.q2", &device)));
        let ActionBatch::Discrete(index) = ActionBatch::new(&case.actions("in.actions"), &device) else {
            panic!("discrete")
        };
        let taken = |q: &Tensor<2>| q.clone().gather(1, index.clone()).squeeze_dim::<1>(1);
        let losses = [critic_loss(taken(&q1), target.clone()), critic_loss(taken(&q2), target)];
        case.check_number("q1_loss", number(losses[0].clone()));
        case.check_number("q2_loss", number(losses[1].clone()));
        let [first, second] = losses;
        let total = first + second;
        case.check_number("critic_loss", number(total.clone()));
        let grads = total.backward();
        case.check("grad.critic.q1", &host(q1.grad(&grads).expect("tracked")));
        case.check("grad.critic.q2", &host(q2.grad(&grads).expect("tracked")));

        let logits = leaf(case.tensor("param.logits", &device));
        let policy = log_probs(logits.clone());
        let loss = soft_value_of_choices(policy.clone(), q1.inner().min_pair(q2.inner()), alpha).mean().neg();
        case.check_number("actor_loss", number(loss.clone()));
        // The sum over choices divided by their number.
        case.check_number("legacy_actor_loss_mean_over_actions", number(loss.clone()) / choices);
        let grads = loss.backward();
        case.check("grad.actor.logits", &host(logits.grad(&grads).expect("tracked")));

        let policy = Dist::Categorical { log_probs: policy.inner() };
        let entropy = policy.entropy();
        case.check_number("entropy_mean", number(entropy.clone().mean()));
        let loss = temperature_loss(log_alpha.clone(), entropy.neg(), target_entropy);
        case.check_number("alpha_loss", number(loss.clone()));
        case.check_number("legacy_alpha_loss_mean_over_actions", number(loss.clone()) / choices);
        let grads = loss.backward();
        case.check("grad.alpha.log_alpha", &host(log_alpha.grad(&grads).expect("tracked")));
    }
    case.finish(&[]);
}
