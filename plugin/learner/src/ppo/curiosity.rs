//! Curiosity: an intrinsic reward for what is new, with a value of its own (Burda et al. 2018, "Exploration by random
//! network distillation", RND).
//!
//! A target network with random weights, which never learn, maps each observation to numbers. A predictor learns to
//! predict these from the observations that were seen. Its error is the intrinsic reward: it is large where the agent
//! was seldom. The critic has a second head, which estimates the return of these rewards. That return goes on over the
//! ends of episodes. Otherwise an agent would fear them, since what it has yet to discover would be lost.
//!
//! The folder, in reading order:
//!
//! - `networks`: target and predictor.
//! - `arrivals`: the observation to which each step led.
//! - `returns`: the formulas: endless advantages, and their sum with those of the game.

mod arrivals;
mod networks;
mod returns;

use crate::{
    FileError, LearnError, ObsKind, Observations, Rollout,
    device::guarded,
    file::TensorFile,
    learner::LearnerBase,
    nn::{
        Adam, AdamConfig, FlatGrads, ImageNet, Init, Linear, NamedGrads, ParamSource, check_loss, frozen, host, matrix,
        path, tracked,
    },
    norm::{ObsNormalizer, ObsStats, RewardNormalizer, put_stats, take_stats},
    policy::{Critic, Policy},
    ppo::{
        Curiosity, PpoConfig,
        batch::minibatches,
        curiosity::{
            arrivals::Arrivals,
            networks::{RndShape, RndShapes},
        },
    },
};
use burn::tensor::{Device, Tensor};
use playbot_kernels::host_numbers::is_host;

pub use crate::ppo::curiosity::{
    networks::{Predictor, RndNet, prediction_errors},
    returns::{combined_advantages, endless_gae},
};

/// Vectors of which the error is computed at a time.
const VECTORS_AT_A_TIME: usize = 4096;

/// Bound of a gradient that is not clipped.
const UNBOUNDED: f64 = 1e30;

/// Names of the tensors in a checkpoint.
const TARGET: &str = "curiosity.target";
const OBSERVATIONS: &str = "curiosity.obs_norm";
const REWARDS: &str = "curiosity.reward_norm";

/// Target and predictor, with all else that the intrinsic reward depends on.
#[derive(Debug)]
pub(super) struct Rnd {
    target: RndNet,
    predictor: Predictor,
    adam: Adam,
    observations: ObsNormalizer,
    /// Divides by the running deviation of the discounted return. It is never reset, since that return is endless.
    rewards: RewardNormalizer,
}

/// What an update's intrinsic rewards lead to, one entry per row.
#[derive(Debug)]
pub(super) struct Judged {
    /// Advantages of both kinds of rewards, by their weights.
    pub(super) advantages: Vec<f32>,
    /// The target of the critic's second head.
    pub(super) returns: Vec<f32>,
    /// Mean intrinsic reward of a step, scaled.
    pub(super) reward: f64,
    /// Mean loss of the predictor over its gradient steps.
    pub(super) predictor_loss: f64,
}

impl Rnd {
    /// Creates target and predictor with starting weights from the streams `curiosity.target` and
    /// `curiosity.predictor`; `None` without curiosity.
    ///
    /// # Errors
    /// [`LearnError::Config`] if images are too small for the convolutions.
    pub(super) fn fresh(config: &PpoConfig, base: &LearnerBase) -> Result<Option<Self>, LearnError> {
        let Some(shapes) = shapes(config, base.spec.obs) else { return Ok(None) };
        let device = base.device.plain();
        let net = |shape: &RndShape, name: &str| guarded(&device, || shape.fresh(&base.streams, name, &device));
        let (target, predictor) = (net(&shapes.target, TARGET)?, net(&shapes.predictor, "curiosity.predictor")?);
        Ok(Some(Self::with_nets(config, base, target, Predictor(predictor))))
    }

    /// Reads them out of a checkpoint, whose predictor has learned in so many `steps`.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen.
    pub(super) fn stored(
        config: &PpoConfig,
        base: &LearnerBase,
        file: &mut TensorFile,
        steps: u64,
    ) -> Result<Option<Self>, FileError> {
        let Some(shapes) = shapes(config, base.spec.obs) else { return Ok(None) };
        let device = base.device.plain();
        let target = shapes.target.stored(file, TARGET, &device)?;
        let predictor = Predictor(shapes.predictor.stored(file, "curiosity.predictor", &device)?);
        let mut rnd = Self::with_nets(config, base, target, predictor);
        file.take_adam(&mut rnd.adam, "", &mut rnd.predictor, steps)?;
        take_stats(file, OBSERVATIONS, &mut rnd.observations.stats)?;
        take_stats(file, REWARDS, &mut rnd.rewards.stats)?;
        rnd.rewards.returns = file.take_f64(&format!("{REWARDS}.returns"), None)?;
        Ok(Some(rnd))
    }

    fn with_nets(config: &PpoConfig, base: &LearnerBase, target: RndNet, predictor: Predictor) -> Self {
        Self {
            target: frozen(&target),
            predictor: tracked(&predictor),
            adam: Adam::new(AdamConfig { eps: config.adam_eps, ..AdamConfig::default() }),
            observations: ObsNormalizer::new(base.spec.obs.numbers()),
            rewards: RewardNormalizer::new(config.curiosity.gamma()),
        }
    }

    /// Adds everything to a checkpoint but the number of the predictor's steps.
    pub(super) fn put(&self, file: &mut TensorFile) -> Result<(), FileError> {
        file.put_network(TARGET, &self.target)?;
        file.put_network("", &self.predictor)?;
        file.put_adam(&self.adam)?;
        put_stats(file, OBSERVATIONS, &self.observations.stats);
        put_stats(file, REWARDS, &self.rewards.stats);
        file.put_f64(&format!("{REWARDS}.returns"), &self.rewards.returns);
        Ok(())
    }

    /// Returns the number of gradient steps of the predictor.
    pub(super) fn steps(&self) -> u64 {
        self.adam.steps()
    }

    /// Takes over what another run has learned to predict. The optimiser stays new, and so do the returns of its
    /// environments.
    pub(super) fn take_over(&mut self, other: &Self) {
        self.target = other.target.clone();
        self.predictor = tracked(&other.predictor);
        self.observations = other.observations.clone();
        self.rewards.stats = other.rewards.stats.clone();
    }

    /// Rewards what is new in a rollout, and then trains the predictor on a share of it.
    ///
    /// `extrinsic` holds the advantages of the game's rewards. `critic` plays the learner's policy with the second head
    /// as its critic ([`endless_critic`]).
    ///
    /// # Errors
    /// [`LearnError::Shape`] if the rollout lacks its last states; [`LearnError::NotFinite`] and
    /// [`LearnError::Exploded`] name what diverged.
    pub(super) fn update(
        &mut self,
        rollout: &Rollout,
        extrinsic: &[f32],
        critic: &Policy,
        config: &PpoConfig,
        base: &LearnerBase,
    ) -> Result<Judged, LearnError> {
        let device = base.device.plain();
        let arrivals = Arrivals::of(rollout)?;
        arrivals.add_to(&mut self.observations);
        let stats = self.observations.snapshot();
        let (targets, errors) = self.errors(&arrivals, &stats, &device)?;
        self.rewards.update(&errors, &vec![false; errors.len()], rollout.envs)?;
        let rewards: Vec<f32> = errors.iter().map(|&error| self.rewards.scale(error)).collect();
        let (values, next_values) = endless_values(rollout, critic)?;
        let (gamma, lambda) = (config.curiosity.gamma(), config.lambda);
        let endless = endless_gae(&rewards, &values, &next_values, gamma, lambda);
        let mut rng = base.streams.stream("curiosity.minibatches", base.updates);
        let batches = minibatches(config, rollout.rows(), &mut rng);
        let predictor_loss = self.train(&arrivals, &stats, &targets, batches, config, &device)?;
        Ok(Judged {
            advantages: combined_advantages(extrinsic, &endless.advantages, config.curiosity.weights()),
            returns: endless.returns,
            reward: rewards.iter().map(|&reward| f64::from(reward)).sum::<f64>() / rewards.len() as f64,
            predictor_loss,
        })
    }

    /// Returns the target's numbers for all arrivals, and the predictor's mean squared error of each.
    fn errors(
        &self,
        arrivals: &Arrivals<'_>,
        stats: &ObsStats,
        device: &Device,
    ) -> Result<(Vec<f32>, Vec<f32>), LearnError> {
        let predictor = frozen(&self.predictor);
        let (mut targets, mut errors) = (Vec::new(), Vec::new());
        let all: Vec<usize> = (0..arrivals.len()).collect();
        for rows in all.chunks(self.at_a_time().unwrap_or(VECTORS_AT_A_TIME)) {
            let x = arrivals.batch(rows, stats, device);
            let wanted = self.target.forward(&x)?;
            errors.extend(host(prediction_errors(predictor.0.forward(&x)?, wanted.clone()))?);
            targets.extend(host(wanted)?);
        }
        for &error in &errors {
            check_loss("intrinsic reward", error, self.adam.steps())?;
        }
        Ok((targets, errors))
    }

    /// Does a gradient step of the predictor on a share of each minibatch, and returns the mean loss.
    fn train(
        &mut self,
        arrivals: &Arrivals<'_>,
        stats: &ObsStats,
        targets: &[f32],
        batches: impl Iterator<Item = Vec<usize>>,
        config: &PpoConfig,
        device: &Device,
    ) -> Result<f64, LearnError> {
        let before = self.adam.steps();
        let width = targets.len() / arrivals.len().max(1);
        let mut losses = Vec::new();
        for batch in batches {
            // The rows are in random order, so the first of them are a random share.
            let rows = &batch[..config.curiosity.share_of(batch.len())];
            let (mut on_host, mut on_device, mut loss_of_batch) = (NamedGrads::default(), None, None);
            for part in rows.chunks(self.at_a_time().unwrap_or(rows.len()).max(1)) {
                let share = part.len() as f64 / rows.len() as f64;
                let wanted = part.iter().flat_map(|&row| &targets[row * width..(row + 1) * width]).copied().collect();
                let wanted = matrix(wanted, part.len(), width, device);
                let predicted = self.predictor.0.forward(&arrivals.batch(part, stats, device))?;
                let loss = prediction_errors(predicted, wanted.autodiff()).mean() * share;
                let of_part = loss.clone().inner();
                loss_of_batch = Some(loss_of_batch.map_or(of_part.clone(), |sum: Tensor<1>| sum + of_part));
                if is_host(device) {
                    on_host.add(NamedGrads::take(&mut self.predictor, "", loss.backward())?);
                } else {
                    let grads = FlatGrads::take(&mut self.predictor, loss.backward());
                    on_device = Some(match on_device {
                        None => grads,
                        Some(sum) => sum + grads,
                    });
                }
            }
            let lr = config.curiosity.lr();
            match on_device {
                Some(grads) => drop(self.adam.step_on_device(&mut self.predictor, grads, lr, UNBOUNDED)),
                None => self.adam.step(&mut self.predictor, "", &on_host, lr, 1.0)?,
            }
            losses.extend(loss_of_batch);
        }
        let losses = host(Tensor::cat(losses, 0))?;
        for (steps, &loss) in (before..).zip(&losses) {
            check_loss("predictor_loss", loss, steps)?;
        }
        Ok(losses.iter().map(|&loss| f64::from(loss)).sum::<f64>() / losses.len() as f64)
    }

    /// Returns how many images a network reads at a time; `None` for vectors.
    fn at_a_time(&self) -> Option<usize> {
        self.target.cnn.as_ref().map(ImageNet::images_at_a_time)
    }
}

/// Returns the sizes of target and predictor, which has the hidden layers twice; `None` without curiosity.
fn shapes(config: &PpoConfig, obs: ObsKind) -> Option<RndShapes> {
    let Curiosity::Rnd { hidden, features, .. } = &config.curiosity else { return None };
    let shape = |hidden: Vec<usize>| RndShape {
        obs,
        cnn: config.cnn.clone(),
        hidden,
        features: *features,
        activation: config.activation,
    };
    Some(RndShapes { target: shape(hidden.clone()), predictor: shape([&hidden[..], hidden].concat()) })
}

/// Returns the critic's second head out of `source`; `None` without curiosity. Its starting weights are orthogonal.
pub(super) fn intrinsic_head<S: ParamSource>(
    config: &PpoConfig,
    critic: &Critic,
    source: &mut S,
) -> Result<Option<Linear>, S::Error> {
    if config.curiosity == Curiosity::Off {
        return Ok(None);
    }
    let [width, _] = critic.net.head.weight.dims();
    let weight = source.param(&path(INTRINSIC, "weight"), [width, 1], Init::Orthogonal(1.0))?;
    Ok(Some(Linear { weight, bias: source.param(&path(INTRINSIC, "bias"), [1], Init::Zeros)? }))
}

/// Name of the critic's second head, beside `actor` and `critic`.
pub(super) const INTRINSIC: &str = "intrinsic";

/// Returns `critic` with `head` in place of its own, for the values of intrinsic rewards.
pub(super) fn endless_critic(critic: &Critic, head: &Linear) -> Critic {
    let mut endless = Critic { clock: None, ..critic.clone() };
    endless.net.head = head.clone();
    endless
}

/// Returns the intrinsic values of all rows, and of the state after the last row of each environment.
///
/// If that row ended an episode, the next state is not known yet, and the row's own value takes its place.
fn endless_values(rollout: &Rollout, critic: &Policy) -> Result<(Vec<f32>, Vec<f32>), LearnError> {
    let (rows, envs, latent) = (rollout.rows(), rollout.envs, rollout.latent);
    let values = critic.values_remembering(&rollout.z, &[], &rollout.memory, &rollout.obs, rows)?;
    let last = rows - envs;
    let running: Vec<usize> =
        (0..envs).filter(|env| !rollout.terminated[last + env] && !rollout.truncated[last + env]).collect();
    let mut next_values = values[last..].to_vec();
    let (mut obs, mut z, mut memory) = (Observations::empty(&rollout.obs_kind), Vec::new(), Vec::new());
    let width = rollout.memory_width();
    for &env in &running {
        obs.push(rollout.ends.next_obs.row(env, rollout.obs_kind.numbers()))?;
        z.extend_from_slice(rollout.ends.next_z.get(env * latent..(env + 1) * latent).unwrap_or_default());
        memory.extend_from_slice(rollout.ends.next_memory.get(env * width..(env + 1) * width).unwrap_or_default());
    }
    for (&env, value) in running.iter().zip(critic.values_remembering(&z, &[], &memory, &obs, running.len())?) {
        next_values[env] = value;
    }
    Ok((values, next_values))
}
