//! One gradient step: minibatch → loss → gradient → Adam.

#[cfg(test)]
mod host_loss_tests;

use crate::{
    ActionSpace, Actions, LearnError,
    nn::{
        Adam, CategoricalRows, Dist, DistRows, GaussianRows, HostDist, JointRows, NamedGrads, RowTerms, finite, host,
        scalar,
    },
    policy::{NetInput, Recall},
    ppo::{
        PpoConfig, PpoNets, StepMetrics,
        objective::{PpoBatch, PpoLoss, intrinsic_value_loss, ppo_loss},
        ratio_stats,
    },
    score::{KlDirection, Penalty, PenaltyForm, ScoreConfig, TeacherBatch, penalty},
};
use burn::tensor::Tensor;
use playbot_kernels::{
    host_numbers::{is_host, known_gradient},
    kept_memory::share_each,
};
use std::ops::Range;

/// Computes loss and gradient, clips by the global norm, and does one step of Adam on tracked `nets`.
///
/// With a decoder in `batch` and settings of SCORE, kl_coef times the [`penalty`](fn@penalty) is added to the loss.
///
/// # Errors
/// [`LearnError::NotFinite`] names the first loss, gradient or weight that is not finite, [`LearnError::Exploded`]
/// the first loss beyond all bounds; [`LearnError::Config`] if the networks do not read such observations.
pub fn gradient_step(
    nets: &mut PpoNets,
    adam: &mut Adam,
    batch: &Minibatch,
    config: &PpoConfig,
    score: Option<&ScoreConfig>,
    lr: f64,
) -> Result<StepMetrics, LearnError> {
    let part = std::iter::once((batch.clone(), 1.0));
    step_in_parts(nets, adam, part, config, &UpdateSettings { lr, score, is_warming_up: false })
}

/// One minibatch on the device.
#[derive(Clone, Debug)]
pub struct Minibatch {
    /// Inputs of actor and critic.
    pub inputs: NetInput,
    /// The same after augmentation; `None` without any.
    pub augmented: Option<NetInput>,
    /// The sequences to which the rows belong, for a policy that remembers.
    pub recall: Option<Recall>,
    /// Remaining share of each skill, `[n]`, if ticks are counted.
    pub left: Option<Tensor<1>>,
    /// Numbers that are added to the logits, `[n, choices]`, if some choices are illegal: see
    /// [`Actor::forward_legal`](crate::policy::Actor::forward_legal).
    pub logit_offsets: Option<Tensor<2>>,
    /// 0 for rows whose numbers are held from an earlier tick, and 1 for the others, `[n]`; `None` if none are.
    pub free: Option<Tensor<1>>,
    /// Constants of the PPO loss.
    pub ppo: PpoBatch,
    /// Constants of the penalty, if there is one.
    pub teacher: Option<TeacherBatch>,
    /// Returns of intrinsic rewards, `[n]`; `None` without curiosity.
    pub intrinsic_returns: Option<Tensor<1>>,
}

/// The terms of a minibatch's loss.
#[derive(Debug)]
pub(super) struct Losses {
    pub(super) ppo: PpoLoss,
    pub(super) penalty: Option<Penalty>,
    /// The minimised total.
    pub(super) total: Tensor<1>,
}

impl Losses {
    /// Computes the terms from the outputs of actor and critic for `batch`. With a decoder in `batch` and settings of
    /// SCORE, kl_coef times the [`penalty`] is added. While the critic warms up only its loss is minimised.
    ///
    /// # Errors
    /// [`LearnError::Action`] if policy, decoder and actions differ in kind.
    pub(super) fn of(
        dist: &Dist,
        values: Tensor<1>,
        batch: &Minibatch,
        config: &PpoConfig,
        &UpdateSettings { score, is_warming_up, .. }: &UpdateSettings<'_>,
    ) -> Result<Self, LearnError> {
        let ppo = ppo_loss(dist, values, &batch.ppo, config.clip, config.clip_value_loss)?;
        let of_critic = ppo.value_loss.clone() * config.vf_coef;
        let mut total = match is_warming_up {
            true => of_critic,
            false => ppo.policy_loss.clone() - ppo.entropy.clone() * config.ent_coef + of_critic,
        };
        let mut penalised = None;
        if let (Some(teacher), Some(score)) = (&batch.teacher, score) {
            let found = penalty(score, &teacher.dist, dist, teacher.confidence.clone())?;
            if !is_warming_up {
                total = total + found.term.clone() * score.kl_coef;
            }
            penalised = Some(found);
        }
        Ok(Self { ppo, penalty: penalised, total })
    }

    /// Returns the terms as plain numbers, except for the norm of the gradient; all are checked.
    pub(super) fn metrics(&self, batch: &Minibatch, config: &PpoConfig, steps: u64) -> Result<StepMetrics, LearnError> {
        let number = |tensor: &Tensor<1>| scalar(tensor.clone().inner()).map(f64::from);
        let ratios = ratio_stats(&host(self.ppo.log_ratio.clone().inner())?, config.clip);
        let mut metrics = StepMetrics {
            policy_loss: number(&self.ppo.policy_loss)?,
            value_loss: number(&self.ppo.value_loss)?,
            entropy: number(&self.ppo.entropy)?,
            approx_kl: ratios.approx_kl,
            clip_fraction: ratios.clip_fraction,
            total_loss: number(&self.total)?,
            ..StepMetrics::default()
        };
        if let (Some(teacher), Some(Penalty { kl, term })) = (&batch.teacher, &self.penalty) {
            metrics.decoder_kl = number(&kl.clone().mean())?;
            metrics.kl_penalty = number(term)?;
            metrics.confidence = teacher.mean_confidence;
        }
        metrics.check_losses(steps)?;
        Ok(metrics)
    }
}

/// Settings that change from update to update.
#[derive(Clone, Copy, Debug)]
pub(super) struct UpdateSettings<'a> {
    /// Learning rate.
    pub(super) lr: f64,
    /// Settings of SCORE, with the present weight of the penalty.
    pub(super) score: Option<&'a ScoreConfig>,
    /// True if only the critic learns.
    pub(super) is_warming_up: bool,
}

impl UpdateSettings<'_> {
    /// Returns whether the loss is a mean over rows; it is, except for the penalties of the released code.
    pub(super) fn has_mean_loss(&self) -> bool {
        self.score.is_none_or(|score| score.penalty == PenaltyForm::Mean)
    }
}

/// Returns the minimised loss, with its metrics.
fn loss(
    nets: &PpoNets,
    batch: &Minibatch,
    config: &PpoConfig,
    moment: &UpdateSettings<'_>,
    steps: u64,
) -> Result<(Tensor<1>, StepMetrics), LearnError> {
    let Outputs { dist, values, intrinsic } = outputs(nets, &batch.inputs, batch, config, moment)?;
    let augmentation = augmentation_loss(nets, &dist, &values, batch, config, moment)?;
    let (mut total, mut metrics) = if is_host(&values.device()) && moment.has_mean_loss() {
        let loss = HostLoss::of(&dist, &values, batch, config, moment, steps)?;
        let metrics = loss.metrics;
        (loss.tensor(&dist, values), metrics)
    } else {
        let losses = Losses::of(&dist, values, batch, config, moment)?;
        let metrics = losses.metrics(batch, config, steps)?;
        (losses.total, metrics)
    };
    if let Some((values, returns)) = intrinsic.zip(batch.intrinsic_returns.clone()) {
        let of_intrinsic = intrinsic_value_loss(values, returns);
        metrics.intrinsic_value_loss = finite("intrinsic_value_loss", &of_intrinsic, steps)?;
        metrics.total_loss += config.vf_coef * metrics.intrinsic_value_loss;
        total = total + of_intrinsic * config.vf_coef;
    }
    let Some(augmentation) = augmentation else { return Ok((total, metrics)) };
    let augmentation_loss = finite("augmentation_loss", &augmentation, steps)?;
    let total_loss = metrics.total_loss + config.augment_coef * augmentation_loss;
    Ok((total + augmentation * config.augment_coef, StepMetrics { augmentation_loss, total_loss, ..metrics }))
}

/// The outputs of actor and critic.
pub(super) struct Outputs {
    pub(super) dist: Dist,
    pub(super) values: Tensor<1>,
    /// Values of intrinsic rewards, if the critic has a head for them.
    pub(super) intrinsic: Option<Tensor<1>>,
}

/// Returns the outputs of actor and critic for `inputs`: those of `batch`, or augmented ones.
pub(super) fn outputs(
    nets: &PpoNets,
    inputs: &NetInput,
    batch: &Minibatch,
    config: &PpoConfig,
    moment: &UpdateSettings<'_>,
) -> Result<Outputs, LearnError> {
    let inputs = nets.actor.recall(nets.actor.join(inputs)?, batch.recall.as_ref())?;
    let dist = nets.actor.forward_legal(inputs.clone(), batch.logit_offsets.as_ref()).with_free(batch.free.as_ref());
    let is_apart = moment.is_warming_up || !config.critic_trains_cnn;
    let features = nets.critic.net.features(if is_apart { inputs.detach() } else { inputs });
    let intrinsic = nets.intrinsic.as_ref().map(|head| head.number(features.clone()));
    Ok(Outputs { dist, values: nets.critic.values_of(features, batch.left.clone()), intrinsic })
}

/// Does [`gradient_step`] on a minibatch that comes in parts, each with its share of the rows.
pub(super) fn step_in_parts(
    nets: &mut PpoNets,
    adam: &mut Adam,
    parts: impl Iterator<Item = (Minibatch, f64)>,
    config: &PpoConfig,
    moment: &UpdateSettings<'_>,
) -> Result<StepMetrics, LearnError> {
    let (mut metrics, mut sum) = (StepMetrics::default(), NamedGrads::default());
    let steps = adam.steps();
    for (part, share) in parts {
        let (total, of_part) = loss(nets, &part, config, moment, steps)?;
        metrics.add(&of_part, share);
        // A whole minibatch is not multiplied by 1.
        let total = if share < 1.0 { total * share } else { total };
        sum.add(NamedGrads::take(nets, "", total.backward())?);
    }
    let (norm, scale) = sum.clip_factor(config.max_grad_norm, steps)?;
    metrics.grad_norm = norm;
    adam.step(nets, "", &sum, moment.lr, scale)?;
    Ok(metrics)
}

/// Returns the loss that makes actor and critic insensitive to image augmentations (Raileanu et al. 2021, "Automatic
/// data augmentation for generalization in reinforcement learning", DrAC).
///
/// It is mean(KL(π(s) ‖ π(s'))) + mean((V(s') - V(s))²) for the changed pictures s' of a minibatch, `[1]`; `None`
/// without any, and while the critic warms up. The outputs for the originals, `dist` and `values`, are constants.
///
/// # Errors
/// [`LearnError::Config`] if the networks do not read such observations.
pub(super) fn augmentation_loss(
    nets: &PpoNets,
    dist: &Dist,
    values: &Tensor<1>,
    batch: &Minibatch,
    config: &PpoConfig,
    moment: &UpdateSettings<'_>,
) -> Result<Option<Tensor<1>>, LearnError> {
    // While only the critic learns the actor must not change.
    let Some(changed) = batch.augmented.as_ref().filter(|_| !moment.is_warming_up) else { return Ok(None) };
    let of_changed = outputs(nets, changed, batch, config, moment)?;
    let divergence = dist.clone().detach().kl(&of_changed.dist)?.mean();
    let difference = (of_changed.values - values.clone().detach()).square().mean();
    Ok(Some(divergence + difference))
}

// The loss of a minibatch with its gradient in host memory, row by row.

/// Rows that a thread takes at a time.
const ROWS: usize = 64;

/// Number of products that take as long as the work for each number of a distribution.
const OF_A_NUMBER: usize = 64;

/// A loss and its derivatives, by the formulas of `objective` and of the mean penalty. A graph of small operations
/// would be slower than this arithmetic.
#[derive(Debug)]
pub(super) struct HostLoss {
    pub(super) metrics: StepMetrics,
    /// By log-probabilities or means, `[n, dim]`.
    of_head: Vec<f32>,
    /// By ln σ, `[n, dim]`; empty for choices.
    of_log_std: Vec<f32>,
    /// By values, `[n]`.
    of_values: Vec<f32>,
}

/// The data that the loss of each row depends on.
struct Rows<'a> {
    config: &'a PpoConfig,
    moment: &'a UpdateSettings<'a>,
    policy: HostDist,
    decoder: Option<HostDist>,
    /// Confidence of the decoder; empty without it.
    confidence: Vec<f32>,
    actions: Actions,
    values: Vec<f32>,
    old_log_probs: Vec<f32>,
    old_values: Vec<f32>,
    advantages: Vec<f32>,
    returns: Vec<f32>,
}

/// Some rows, and the memory for their derivatives.
struct Piece<'a> {
    rows: Range<usize>,
    of_head: &'a mut [f32],
    of_log_std: &'a mut [f32],
    of_values: &'a mut [f32],
    sums: StepMetrics,
}

impl HostLoss {
    /// Computes the loss for the outputs of actor and critic on `batch`, with the mean penalty if there is one.
    ///
    /// # Errors
    /// [`LearnError::Action`] if policy, decoder and actions differ in kind; [`LearnError::NotFinite`] and
    /// [`LearnError::Exploded`] name the first term that diverged after so many steps of the optimizer.
    pub(super) fn of(
        dist: &Dist,
        values: &Tensor<1>,
        batch: &Minibatch,
        config: &PpoConfig,
        moment: &UpdateSettings<'_>,
        steps: u64,
    ) -> Result<Self, LearnError> {
        let rows = Rows::read(dist, values, batch, config, moment)?;
        let loss = rows.loss()?;
        loss.metrics.check_losses(steps)?;
        Ok(loss)
    }

    /// Returns the loss as the end of the graph that leads to `dist` and `values`.
    pub(super) fn tensor(self, dist: &Dist, values: Tensor<1>) -> Tensor<1> {
        let total = known_gradient(values, self.metrics.total_loss as f32, self.of_values);
        match dist {
            Dist::Joint(parts) => {
                let all: usize = parts.iter().map(columns).sum();
                let mut first = 0;
                parts.iter().fold(total, |total, part| {
                    let at = first..first + columns(part);
                    first = at.end;
                    let of_head = self.of_head.chunks_exact(all).flat_map(|row| &row[at.clone()]).copied().collect();
                    with_gradient(total, part, of_head, self.of_log_std.clone())
                })
            }
            dist => with_gradient(total, dist, self.of_head, self.of_log_std),
        }
    }
}

/// Returns the columns of the head that belong to a distribution.
fn columns(dist: &Dist) -> usize {
    match dist {
        Dist::Categorical { log_probs: head } | Dist::Gaussian { mean: head, .. } => head.dims()[1],
        Dist::Joint(parts) => parts.iter().map(columns).sum(),
    }
}

/// Adds a distribution whose derivatives are known, to the end of the graph that leads to it.
fn with_gradient(total: Tensor<1>, dist: &Dist, of_head: Vec<f32>, of_log_std: Vec<f32>) -> Tensor<1> {
    match dist {
        Dist::Categorical { log_probs } => total + known_gradient(log_probs.clone(), 0.0, of_head),
        Dist::Gaussian { mean, log_std, .. } => {
            let [rows, dim] = log_std.dims();
            let of_log_std = if rows == 1 { column_sums(&of_log_std, dim) } else { of_log_std };
            total + known_gradient(mean.clone(), 0.0, of_head) + known_gradient(log_std.clone(), 0.0, of_log_std)
        }
        // Parts have no parts of their own.
        Dist::Joint(_) => total,
    }
}

fn column_sums(numbers: &[f32], columns: usize) -> Vec<f32> {
    let mut sums = vec![0.0; columns];
    for row in numbers.chunks_exact(columns) {
        sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
    }
    sums
}

impl<'a> Rows<'a> {
    fn read(
        dist: &Dist,
        values: &Tensor<1>,
        batch: &Minibatch,
        config: &'a PpoConfig,
        moment: &'a UpdateSettings<'a>,
    ) -> Result<Self, LearnError> {
        let teacher = batch.teacher.as_ref().filter(|_| moment.score.is_some());
        let column = |tensor: &Tensor<1>| host(tensor.clone());
        Ok(Self {
            config,
            moment,
            policy: dist.clone().to_host()?,
            decoder: teacher.map(|teacher| teacher.dist.clone().to_host()).transpose()?,
            confidence: teacher.map_or_else(|| Ok(Vec::new()), |teacher| column(&teacher.confidence))?,
            actions: batch.ppo.actions.to_host()?,
            values: host(values.clone().inner())?,
            old_log_probs: column(&batch.ppo.old_log_probs)?,
            old_values: column(&batch.ppo.old_values)?,
            advantages: column(&batch.ppo.advantages)?,
            returns: column(&batch.ppo.returns)?,
        })
    }

    fn loss(&self) -> Result<HostLoss, LearnError> {
        let from_these = self.moment.score.is_some_and(|score| score.kl_direction == KlDirection::PolicyDecoder);
        let (policy, decoder) = (&self.policy, self.decoder.as_ref());
        let differ = || LearnError::Action("policy, decoder and actions differ in kind".to_owned());
        if decoder.is_some_and(|decoder| decoder.space != policy.space) {
            return Err(differ());
        }
        let stds = policy.space.numbers();
        match (policy.space, &self.actions) {
            (ActionSpace::Discrete(_), Actions::Discrete(actions)) => {
                Ok(self.by_pieces(stds, |rows| CategoricalRows::new(policy, actions, decoder, rows, from_these)))
            }
            (ActionSpace::Continuous(_), Actions::Continuous { values, .. }) => {
                Ok(self.by_pieces(stds, |rows| GaussianRows::new(policy, values, decoder, rows, from_these)))
            }
            (ActionSpace::Mixed(_), Actions::Mixed { options, values, .. }) => {
                let actions = (&options[..], &values[..]);
                Ok(self.by_pieces(stds, |rows| JointRows::new(policy, actions, decoder, rows, from_these)))
            }
            _ => Err(differ()),
        }
    }

    /// Computes the loss piece by piece; with `stds` derivatives by ln σ in each row.
    fn by_pieces<D: DistRows>(&self, stds: usize, dist_of: impl Fn(Range<usize>) -> D + Sync) -> HostLoss {
        let (n, dim) = (self.values.len(), self.policy.dim());
        let (mut of_head, mut of_log_std, mut of_values) = (vec![0.0; n * dim], vec![0.0; n * stds], vec![0.0; n]);
        let mut std_rows = of_log_std.chunks_mut((ROWS * stds).max(1));
        let pieces = of_head.chunks_mut(ROWS * dim).zip(of_values.chunks_mut(ROWS)).enumerate();
        let mut pieces: Vec<_> = pieces
            .map(|(piece, (of_head, of_values))| Piece {
                rows: piece * ROWS..piece * ROWS + of_values.len(),
                of_head,
                of_log_std: std_rows.next().unwrap_or_default(),
                of_values,
                sums: StepMetrics::default(),
            })
            .collect();
        share_each(&mut pieces, n * dim * OF_A_NUMBER, |_, piece| self.compute(&dist_of(piece.rows.clone()), piece));
        let mut metrics = StepMetrics::default();
        pieces.iter().for_each(|piece| metrics.add(&piece.sums, 1.0 / n as f64));
        metrics.total_loss = self.total(&metrics);
        HostLoss { metrics, of_head, of_log_std, of_values }
    }

    fn total(&self, means: &StepMetrics) -> f64 {
        let PpoConfig { ent_coef, vf_coef, .. } = self.config;
        let of_critic = means.value_loss * vf_coef;
        match self.moment.score {
            _ if self.moment.is_warming_up => of_critic,
            None => means.policy_loss - means.entropy * ent_coef + of_critic,
            Some(score) => means.policy_loss - means.entropy * ent_coef + of_critic + means.kl_penalty * score.kl_coef,
        }
    }

    fn compute(&self, dist: &impl DistRows, piece: &mut Piece<'_>) {
        let (dim, stds) = (self.policy.dim(), piece.of_log_std.len() / piece.rows.len());
        for (i, row) in piece.rows.clone().enumerate() {
            let terms = dist.terms(i);
            let by = self.add_policy_row(row, terms, &mut piece.sums);
            piece.of_values[i] = self.add_value_row(row, &mut piece.sums);
            if !self.moment.is_warming_up {
                let (head, log_std) = (i * dim..(i + 1) * dim, i * stds..(i + 1) * stds);
                dist.gradient(i, by, &mut piece.of_head[head], &mut piece.of_log_std[log_std]);
            }
        }
    }

    /// Adds the terms of a row, and returns the derivatives of the loss by these.
    fn add_policy_row(&self, row: usize, terms: RowTerms, sums: &mut StepMetrics) -> RowTerms {
        let (n, clip) = (self.values.len() as f64, self.config.clip as f32);
        let log_ratio = terms.log_prob - self.old_log_probs[row];
        let (ratio, gain) = (libm::expf(log_ratio), -self.advantages[row]);
        let (free, clipped) = (gain * ratio, gain * ratio.clamp(1.0 - clip, 1.0 + clip));
        sums.policy_loss += f64::from(free.max(clipped));
        sums.entropy += f64::from(terms.entropy);
        let moved = libm::expm1(f64::from(log_ratio));
        sums.approx_kl += moved - f64::from(log_ratio);
        sums.clip_fraction += f64::from(u8::from(moved.abs() > self.config.clip));
        let mut by = RowTerms {
            // Where clipping decides, the gradient is 0.
            log_prob: if free < clipped { 0.0 } else { free / n as f32 },
            entropy: (-self.config.ent_coef / n) as f32,
            kl: 0.0,
        };
        if let (Some(score), Some(&weight)) = (self.moment.score, self.confidence.get(row)) {
            sums.decoder_kl += f64::from(terms.kl);
            sums.kl_penalty += f64::from(weight * terms.kl);
            sums.confidence += f64::from(weight);
            by.kl = (score.kl_coef / n) as f32 * weight;
        }
        by
    }

    /// Adds the critic's error in a row, and returns the derivative of the loss by the value.
    fn add_value_row(&self, row: usize, sums: &mut StepMetrics) -> f32 {
        let (value, old, wanted) = (self.values[row], self.old_values[row], self.returns[row]);
        let (error, clip) = (value - wanted, self.config.clip as f32);
        let change = (value - old).clamp(-clip, clip);
        let clipped = old + change - wanted;
        let is_clipped = self.config.clip_value_loss && clipped * clipped > error * error;
        let worst = if is_clipped { clipped } else { error };
        sums.value_loss += 0.5 * f64::from(worst * worst);
        let moves = !is_clipped || change == value - old;
        let scale = (self.config.vf_coef / self.values.len() as f64) as f32;
        if moves { worst * scale } else { 0.0 }
    }
}
