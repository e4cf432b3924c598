//! The gradient steps of SAC: critics, actor, temperature.

use crate::{
    ActionSpace, LearnError,
    nn::{
        Adam, Dist, Linear, LogProbForm, Mlp, NamedGrads, Parameters, SquashedDraw, SquashedGaussian, finite, frozen,
        matrix, vector,
    },
    policy::{Actor, LogStd},
    sac::{Critics, SacBatch, SacNets, critics::Pool},
    score::{Penalty, ScoreConfig, penalty},
};
use burn::tensor::{Device, Gradients, Tensor};
use playbot_kernels::{elementwise::Activation, host_ops::exp};

/// Metrics of a step of the critics, before it was taken.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CriticStep {
    /// Mean squared error of each critic.
    pub losses: Vec<f64>,
    /// Mean of all critics over the batch.
    pub q_values: f64,
    /// Norm of the gradient.
    pub grad_norm: f64,
}

/// Metrics of a step of the actor, before it was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActorStep {
    /// -mean(V), without the penalty.
    pub actor_loss: f64,
    /// Estimate of the entropy in nats, -mean(ln π): exact for discrete actions.
    pub entropy: f64,
    /// Mean divergence between decoder (or prior) and policy, not weighted.
    pub decoder_kl: f64,
    /// The penalty that is added to the loss, in the form of [`ScoreConfig::penalty`], without kl_coef.
    pub kl_penalty: f64,
    /// Mean of the decoder's confidence.
    pub confidence: f64,
    /// Norm of the gradient.
    pub grad_norm: f64,
}

/// Metrics of a step of the temperature, before it was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TemperatureStep {
    /// mean(-α (ln π + target entropy)), where α is the temperature.
    pub temperature_loss: f64,
    /// Mean of ln π.
    pub log_prob: f64,
}

/// The actions over which a loss takes its expectation in each row.
#[expect(clippy::large_enum_variant, reason = "there is one per gradient step")]
enum PolicyActions {
    /// All choices, by their ln π, `[n, choices]`.
    All(Tensor<2>),
    /// One draw, and the cost of its distribution that the temperature weighs: ln π of the draw, or the divergence
    /// from a prior.
    Sample { draw: SquashedDraw, cost: Tensor<1> },
}

impl PolicyActions {
    fn new(dist: Dist, prior: Option<&Dist>, noise: Option<&Tensor<2>>) -> Result<Self, LearnError> {
        let divergence = prior.map(|prior| dist.kl(prior)).transpose()?;
        match (dist, noise) {
            (Dist::Categorical { log_probs }, _) => Ok(Self::All(log_probs)),
            (Dist::Gaussian { mean, log_std, .. }, Some(noise)) => {
                let device = noise.device();
                let squashed = SquashedGaussian::unit(mean, log_std, &device);
                let draw = squashed.draw(noise.clone(), LogProbForm::Eps);
                let cost = divergence.unwrap_or_else(|| draw.log_prob.clone());
                Ok(Self::Sample { draw, cost })
            }
            _ => Err(LearnError::Action("noise is needed to draw continuous actions".to_owned())),
        }
    }

    /// Returns V under `critics`, `[n]`.
    fn soft_value(&self, critics: &Critics, pool: Pool, inputs: Tensor<2>, temperature: f64) -> Tensor<1> {
        match self {
            Self::All(log_probs) => {
                soft_value_of_choices(log_probs.clone(), pool.of(critics.of_choices(inputs)), temperature)
            }
            Self::Sample { draw, cost } => {
                let q = pool.of(critics.of_vectors(inputs, draw.action.clone()));
                soft_value(cost.clone(), q, temperature)
            }
        }
    }

    /// Returns ln π of the draw, or E\[ln π\], `[n]`.
    fn log_prob(&self) -> Tensor<1> {
        match self {
            Self::All(log_probs) => (exp(log_probs.clone()) * log_probs.clone()).sum_dim(1).squeeze_dim(1),
            Self::Sample { draw, .. } => draw.log_prob.clone(),
        }
    }

    /// Returns the cost that the temperature weighs, `[n]`: [`Self::log_prob`], or the divergence from a prior.
    fn cost(&self) -> Tensor<1> {
        match self {
            Self::All(_) => self.log_prob(),
            Self::Sample { cost, .. } => cost.clone(),
        }
    }
}

/// Returns y = r + γ V' of each row. V' is the target critics' soft value (by those of [`SacBatch::seen_by_target`])
/// of the actor's actions in the next state.
///
/// `noise` is standard normal, `[n, dim]`, and needed for continuous actions only (here and below).
///
/// # Errors
/// [`LearnError::Action`] without the noise that is needed.
pub fn target_of(
    nets: &SacNets,
    batch: &SacBatch,
    noise: Option<&Tensor<2>>,
    temperature: f64,
    gamma: f64,
) -> Result<Tensor<1>, LearnError> {
    let dist = frozen(&nets.actor).forward_legal(batch.next_inputs.clone(), batch.offsets_of_next());
    let actions = PolicyActions::new(dist, batch.prior_of_next(), noise)?;
    let targets = nets.targets.some(&batch.seen_by_target);
    let next = actions.soft_value(&targets, Pool::Least, batch.next_of_critics(), temperature);
    Ok(q_target(batch.rewards.clone(), batch.continues.clone(), next, gamma))
}

/// Does one step of Adam on all critics.
///
/// # Errors
/// [`LearnError::NotFinite`] names the first loss, gradient or weight that is not finite, [`LearnError::Exploded`] the
/// first loss beyond all bounds; [`LearnError::Action`] as [`target_of`].
pub fn critic_step(
    nets: &mut SacNets,
    adam: &mut Adam,
    batch: &SacBatch,
    noise: Option<&Tensor<2>>,
    temperature: f64,
    gamma: f64,
    lr: f64,
) -> Result<CriticStep, LearnError> {
    let target = target_of(nets, batch, noise, temperature, gamma)?;
    let q = nets.critics.of_actions(batch.of_critics(), &batch.actions);
    let values = Pool::Mean.of(q.clone()).mean();
    let losses: Vec<_> = q.into_iter().map(|q| critic_loss(q, target.clone())).collect();
    let steps = adam.steps();
    let numbers = losses.iter().enumerate().map(|(i, loss)| finite(&format!("q{}_loss", i + 1), loss, steps));
    let numbers = numbers.collect::<Result<_, _>>()?;
    let q_values = finite("q_values", &values, steps)?;
    let total = losses.into_iter().reduce(|a, b| a + b).expect("there is a critic");
    let grad_norm = descend(&mut nets.critics, "", adam, total.backward(), lr)?;
    Ok(CriticStep { losses: numbers, q_values, grad_norm })
}

/// Does one step of Adam on the actor, under the present critics.
///
/// With a decoder in `batch` and settings of SCORE, kl_coef times the [`penalty`](fn@penalty) is added to the loss. A
/// squashed policy is compared before its tanh (see [`crate::nn::unsquashed`]).
///
/// # Errors
/// As [`critic_step`].
pub fn actor_step(
    nets: &mut SacNets,
    adam: &mut Adam,
    batch: &SacBatch,
    noise: Option<&Tensor<2>>,
    temperature: f64,
    score: Option<&ScoreConfig>,
    lr: f64,
) -> Result<ActorStep, LearnError> {
    let dist = nets.actor.forward_legal(batch.inputs.clone(), batch.offsets_of_states());
    let actions = PolicyActions::new(dist.clone(), batch.prior_of_states(), noise)?;
    // If a target uses only some critics, the actor follows the mean of all.
    let pool = if batch.seen_by_target.is_empty() { Pool::Least } else { Pool::Mean };
    let loss = actions.soft_value(&frozen(&nets.critics), pool, batch.of_critics(), temperature).mean().neg();
    let steps = adam.steps();
    let mut metrics = ActorStep {
        actor_loss: finite("actor_loss", &loss, steps)?,
        entropy: -finite("log_prob", &actions.log_prob().mean(), steps)?,
        ..ActorStep::default()
    };
    if batch.prior.is_some() {
        metrics.decoder_kl = finite("prior_kl", &actions.cost().mean(), steps)?;
    }
    let mut total = loss;
    if let (Some(teacher), Some(score)) = (&batch.teacher, score) {
        let Penalty { kl, term } = penalty(score, &teacher.dist, &dist, teacher.confidence.clone())?;
        metrics.decoder_kl = finite("decoder_kl", &kl.mean(), steps)?;
        metrics.kl_penalty = finite("kl_penalty", &term, steps)?;
        metrics.confidence = teacher.mean_confidence;
        total = total + term * score.kl_coef;
    }
    metrics.grad_norm = descend(&mut nets.actor, "actor", adam, total.backward(), lr)?;
    Ok(metrics)
}

/// Does one step of Adam on the logarithm of the temperature, under the present actor. If the batch has a prior, the
/// divergence from it replaces ln π, and -target_entropy is the target divergence.
///
/// # Errors
/// As [`critic_step`].
pub fn temperature_step(
    nets: &mut SacNets,
    adam: &mut Adam,
    batch: &SacBatch,
    noise: Option<&Tensor<2>>,
    target_entropy: f64,
    lr: f64,
) -> Result<TemperatureStep, LearnError> {
    let dist = frozen(&nets.actor).forward_legal(batch.inputs.clone(), batch.offsets_of_states());
    let actions = PolicyActions::new(dist, batch.prior_of_states(), noise)?;
    let log_prob = actions.log_prob();
    let loss = temperature_loss(nets.log_temperature.0.clone(), actions.cost(), target_entropy);
    let steps = adam.steps();
    let metrics = TemperatureStep {
        temperature_loss: finite("temperature_loss", &loss, steps)?,
        log_prob: finite("log_prob", &log_prob.mean(), steps)?,
    };
    descend(&mut nets.log_temperature, "", adam, loss.backward(), lr)?;
    Ok(metrics)
}

/// Does one step of Adam without clipping, and returns the gradient's norm.
fn descend<M: Parameters>(
    network: &mut M,
    prefix: &str,
    adam: &mut Adam,
    gradients: Gradients,
    lr: f64,
) -> Result<f64, LearnError> {
    let grads = NamedGrads::take(network, prefix, gradients)?;
    let (norm, scale) = grads.clip_factor(f64::INFINITY, adam.steps())?;
    adam.step(network, prefix, &grads, lr, scale)?;
    Ok(norm)
}

/// σ at which the tanh of a normal number is nearly uniform: that of the logistic distribution whose tanh is exactly
/// uniform, π/(2√3). The density in [-0.98, 0.98] lies between 0.44 and 0.62 instead of at 0.5.
const NEARLY_UNIFORM: f64 = 0.906_899_682_117_108_9;

/// Returns the policy of play before the first gradient step. It ignores the `inputs` numbers of its observation:
/// uniform over choices, nearly uniform over vectors in [-1, 1].
pub(super) fn explorer(space: ActionSpace, inputs: usize, device: &Device) -> Actor {
    let dim = space.dim();
    let zeros = || Linear {
        weight: matrix(vec![0.0; inputs * dim], inputs, dim, device),
        bias: vector(vec![0.0; dim], device),
    };
    let log_std = match space {
        ActionSpace::Discrete(_) | ActionSpace::Mixed(_) => LogStd::None,
        ActionSpace::Continuous(_) => {
            // In the middle of the range, to which the zeros lead.
            let middle = libm::log(NEARLY_UNIFORM);
            LogStd::Squashed { layer: zeros(), range: (middle - 1.0, middle + 1.0) }
        }
    };
    Actor {
        cnn: None,
        entities: None,
        memory: None,
        space,
        net: Mlp { layers: Vec::new(), head: zeros(), activation: Activation::Relu },
        log_std,
    }
}

// The losses of SAC, as pure functions of tensors, `[n]` per row.
//
// Continuous and discrete actions share one form. With V = E\[Q - α ln π\], where Q is the least of the critics (or
// another reduction) and α the temperature, the actor maximises mean(V), and critics learn y = r + γ V'. For continuous
// actions the expectation is one draw. For discrete ones it is the sum over all choices (Christodoulou 2019, "Soft
// actor-critic for discrete action settings").

/// Returns V of one draw per row: Q - α ln π(a).
pub fn soft_value(log_prob: Tensor<1>, q: Tensor<1>, temperature: f64) -> Tensor<1> {
    q - log_prob * temperature
}

/// Returns V over all choices: Σ π (Q - α ln π), all inputs `[n, choices]`. The gradient flows through π and ln π.
pub fn soft_value_of_choices(log_probs: Tensor<2>, q: Tensor<2>, temperature: f64) -> Tensor<1> {
    let values = q - log_probs.clone() * temperature;
    (exp(log_probs) * values).sum_dim(1).squeeze_dim(1)
}

/// Returns y = r + γ V', where `continues` is 1 for rows whose next state counts and 0 for the others.
pub fn q_target(rewards: Tensor<1>, continues: Tensor<1>, next_values: Tensor<1>, gamma: f64) -> Tensor<1> {
    rewards + continues * next_values * gamma
}

/// Returns mean((Q - y)²), `[1]`.
pub fn critic_loss(q: Tensor<1>, target: Tensor<1>) -> Tensor<1> {
    (q - target).square().mean()
}

/// Returns mean(-α (ln π + target entropy)), `[1]`, where `log_prob` is ln π of a draw or E\[ln π\], and constant.
pub fn temperature_loss(log_temperature: Tensor<1>, log_prob: Tensor<1>, target_entropy: f64) -> Tensor<1> {
    (log_prob + target_entropy).mean() * exp(log_temperature).neg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::Policy;
    use crate::rng::Streams;
    use crate::{ActionValue, DeviceKind, PolicySpec};

    /// Counts how 20,000 actions fall into five bins.
    fn counts(space: ActionSpace) -> [usize; 5] {
        let device = DeviceKind::Flex.plain();
        let spec = PolicySpec { obs: 2.into(), latent: 1, action_space: space };
        let policy = Policy::new(&explorer(space, 3, &device), None, None, spec, device);
        let output = policy.forward(&[5.0], &[-3.0, 4.0], 1).expect("finite");
        let mut rng = Streams::new(1).stream("draw", 0);
        let mut counts = [0; 5];
        for _ in 0..20_000 {
            let bin = match output.sample(0, &mut rng).0 {
                ActionValue::Discrete(choice) => choice as usize,
                ActionValue::Continuous(vector) => ((vector[1] + 1.0) * 2.5) as usize,
                ActionValue::Mixed { .. } => panic!("SAC makes one choice"),
            };
            counts[bin.min(4)] += 1;
        }
        counts
    }

    #[test]
    fn choices_are_equally_likely_and_vectors_nearly() {
        let choices = counts(ActionSpace::Discrete(5));
        assert!(choices.iter().all(|n| (3800..4200).contains(n)), "{choices:?}");
        let vectors = counts(ActionSpace::Continuous(2));
        assert!(vectors.iter().all(|n| (3300..4700).contains(n)), "{vectors:?}");
    }
}
