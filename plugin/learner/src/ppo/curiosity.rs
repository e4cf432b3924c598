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
    EndStates, FileError, LearnError, ObsKind, Observations, Rollout,
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
            returns::chained_gae,
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
    /// as its critic ([`endless_critic`]). `chains` are as in [`tails`].
    ///
    /// # Errors
    /// [`LearnError::Shape`] if the rollout lacks its last states; [`LearnError::NotFinite`] and
    /// [`LearnError::Exploded`] name what diverged.
    pub(super) fn update(
        &mut self,
        (rollout, chains): (&Rollout, &[usize]),
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
        let (values, next_values) = endless_values(rollout, chains, critic)?;
        let (gamma, lambda) = (config.curiosity.gamma(), config.lambda);
        let endless = match chains {
            [] => endless_gae(&rewards, &values, &next_values, gamma, lambda),
            chains => chained_gae(&rewards, &values, &next_values, chains, (gamma, lambda)),
        };
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

/// The state behind the last row of an environment.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Behind {
    /// Not known yet, since an episode ended.
    Unknown,
    /// The number of an environment that goes on.
    Next(usize),
    /// The number of a state among those that were cut off.
    Cut(usize),
}

/// Returns the last row of each environment, and the state behind it.
///
/// `chains` is empty for a rollout of ticks. In one of skills the rows of each environment follow one another: then it holds
/// the end of each such chain, exclusive. The last skill of a chain is cut off, though its episode may go on.
fn tails(rollout: &Rollout, chains: &[usize]) -> Vec<(usize, Behind)> {
    let is_done = |row: usize| rollout.terminated[row] || rollout.truncated[row];
    let first = rollout.rows() - rollout.envs;
    let of_env = |env| (first + env, if is_done(first + env) { Behind::Unknown } else { Behind::Next(env) });
    let of_chain = |&end: &usize| {
        let cut = rollout.ends.cut_rows.binary_search(&(end - 1));
        (end - 1, cut.map_or(Behind::Unknown, Behind::Cut))
    };
    match chains {
        [] => (0..rollout.envs).map(of_env).collect(),
        chains => chains.iter().map(of_chain).collect(),
    }
}

/// Returns the intrinsic values of all rows, and of the state after the last row of each environment or chain. Where that
/// is not known, the row's own value takes its place.
fn endless_values(rollout: &Rollout, chains: &[usize], critic: &Policy) -> Result<(Vec<f32>, Vec<f32>), LearnError> {
    let (rows, latent, width) = (rollout.rows(), rollout.latent, rollout.memory_width());
    let values = critic.values_remembering(&rollout.z, &[], &rollout.memory, &rollout.obs, rows)?;
    let (mut obs, mut z, mut memory) = (Observations::empty(&rollout.obs_kind), Vec::new(), Vec::new());
    let (mut next_values, mut known) = (Vec::new(), Vec::new());
    let EndStates { next_obs, next_z, next_memory, cut_obs, cut_z, cut_memory, .. } = &rollout.ends;
    for (tail, (row, behind)) in tails(rollout, chains).into_iter().enumerate() {
        next_values.push(values[row]);
        let (at, all, skills, memories) = match behind {
            Behind::Unknown => continue,
            Behind::Next(env) => (env, next_obs, next_z, next_memory),
            Behind::Cut(cut) => (cut, cut_obs, cut_z, cut_memory),
        };
        known.push(tail);
        obs.push(all.row(at, rollout.obs_kind.numbers()))?;
        z.extend_from_slice(skills.get(at * latent..(at + 1) * latent).unwrap_or_default());
        memory.extend_from_slice(memories.get(at * width..(at + 1) * width).unwrap_or_default());
    }
    for (&tail, value) in known.iter().zip(critic.values_remembering(&z, &[], &memory, &obs, known.len())?) {
        next_values[tail] = value;
    }
    Ok((values, next_values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ActionSpace, Actions};

    #[test]
    fn a_chain_of_skills_ends_where_its_environment_does() {
        let n = 5;
        let mut skills = Rollout {
            steps: n,
            obs: vec![0.0; n].into(),
            actions: Actions::Continuous { dim: 1, values: vec![0.0; n] },
            log_probs: vec![0.0; n],
            values: vec![0.0; n],
            rewards: vec![0.0; n],
            terminated: vec![true, false, false, false, true],
            truncated: vec![false, true, true, false, false],
            final_values: vec![0.0; n],
            next_values: vec![0.0],
            ..Rollout::new(1, 1, 0, &ActionSpace::Continuous(1))
        };
        skills.ends.cut_rows = vec![1, 2];
        let expected = [(2, Behind::Cut(1)), (4, Behind::Unknown)];
        assert_eq!(tails(&skills, &[3, 5]), expected, "ends of episodes within a chain are none of it");
        assert_eq!(tails(&skills, &[]), [(4, Behind::Unknown)]);
        skills.terminated[4] = false;
        assert_eq!(tails(&skills, &[]), [(4, Behind::Next(0))]);
    }
}
