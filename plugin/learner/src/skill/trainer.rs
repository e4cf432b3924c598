//! Training of the skill model.

use super::held_out::{Best, HeldOut};
use super::metrics::{MetricSums, accuracy};
use super::state_heads::told_numbers;
use super::{
    Dataset, SkillConfig, SkillDescription, SkillForward, SkillMetrics, SkillModel, SkillNets, StateHeads, Window,
    skill_loss,
};
use crate::device::{is_host, update_on};
use crate::nn::{ActionBatch, Adam, AdamConfig, NamedGrads, ObsBatch, check_loss, host, matrix, scalar, tracked};
use crate::norm::ObsStats;
use crate::observation::augmented;
use crate::rng::{ChaCha8Rng, Streams, normal};
use crate::{Actions, DeviceKind, LearnError, ObsKind, Observations};
use burn::tensor::Tensor;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Progress of training, after each batch.
#[derive(Clone, Copy, Debug)]
pub struct SkillProgress {
    /// Number of the running epoch, from 0.
    pub epoch: u64,
    /// Batches done in it.
    pub batch: usize,
    /// Batches it has.
    pub batches: usize,
    /// The batch just done.
    pub metrics: SkillMetrics,
}

/// Trains a skill model on demonstrations, batch by batch, so that the caller can show progress and stop at any time.
#[derive(Debug)]
pub struct SkillTrainer {
    pub(super) config: SkillConfig,
    /// The demonstrations to learn from.
    pub(super) dataset: Dataset,
    pub(super) held_out: Option<HeldOut>,
    pub(super) best: Option<Best>,
    /// The hash of all demonstrations.
    pub(super) fingerprint: u64,
    /// Episodes and steps of all demonstrations.
    pub(super) extent: (usize, usize),
    /// Normalisation of the networks' observations, if any.
    pub(super) stats: Option<Arc<ObsStats>>,
    /// Normalisation of the predicted states, if any.
    pub(super) state_stats: Option<ObsStats>,
    pub(super) nets: SkillNets,
    pub(super) adam: Adam,
    pub(super) streams: Streams,
    pub(super) device: DeviceKind,
    pub(super) epoch: u64,
    pub(super) windows: Vec<Window>,
    pub(super) next: usize,
    pub(super) sums: MetricSums,
    last_epoch: SkillMetrics,
}

impl SkillTrainer {
    /// Creates a trainer with starting weights from `seed`.
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings or images too small for them, [`LearnError::NoWindow`] if no
    /// episode is long enough.
    pub fn new(config: SkillConfig, dataset: Dataset, seed: u64, device: DeviceKind) -> Result<Self, LearnError> {
        Self::check(&config, &dataset)?;
        device.check()?;
        let (streams, plain) = (Streams::new(seed), device.plain());
        let mut nets = SkillNets::new(&config, dataset.observation, dataset.space, &streams, &plain)?;
        if let Some(numbers) = told_numbers(&config, &dataset) {
            nets.state_heads = Some(StateHeads::new(config.cnn.features(), numbers, &streams, &plain));
        }
        Self::with_nets(config, dataset, &nets, seed, device)
    }

    /// Checks that a model of these settings can be learned from `dataset`.
    fn check(config: &SkillConfig, dataset: &Dataset) -> Result<(), LearnError> {
        config.validate()?;
        config.check_observation(dataset.observation)?;
        config.check_space(dataset.space)?;
        if config.tells_states() && dataset.states.is_none() {
            let text = "skill state_weight needs demonstrations with states (Dataset::with_states)";
            return Err(LearnError::Config(text.to_owned()));
        }
        Ok(())
    }

    /// Creates a trainer of `nets`, which has not trained them yet.
    pub(super) fn with_nets(
        config: SkillConfig,
        dataset: Dataset,
        nets: &SkillNets,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        Self::check(&config, &dataset)?;
        let streams = Streams::new(seed);
        let (fingerprint, extent) = (dataset.fingerprint(), (dataset.episodes(), dataset.steps()));
        let (dataset, held_out) = dataset.without_held_out(&config, &streams)?;
        let windows = dataset.windows(config.window, config.windows, &streams, 0)?;
        Ok(Self {
            state_stats: dataset.states.as_ref().and_then(|states| states.stats()),
            stats: if config.norm_obs { dataset.stats().map(Arc::new) } else { None },
            nets: tracked(nets),
            adam: Adam::new(AdamConfig { eps: 1e-8, weight_decay: config.weight_decay, ..AdamConfig::default() }),
            epoch: 0,
            next: 0,
            sums: MetricSums::default(),
            last_epoch: SkillMetrics::default(),
            config,
            fingerprint,
            extent,
            dataset,
            held_out,
            best: None,
            streams,
            device,
            windows,
        })
    }

    /// Returns the settings.
    pub fn config(&self) -> &SkillConfig {
        &self.config
    }

    /// Returns the seed.
    pub fn seed(&self) -> u64 {
        self.streams.seed()
    }

    /// Returns the number of complete passes over the demonstrations.
    pub fn epochs_done(&self) -> u64 {
        self.epoch
    }

    /// Returns the number of batches in the running epoch; it varies a little with the cuts of the episodes.
    pub fn batches_per_epoch(&self) -> usize {
        self.windows.len().div_ceil(self.config.batch)
    }

    /// Batches done in the running epoch.
    pub fn batches_done(&self) -> usize {
        self.next / self.config.batch
    }

    /// Trains on the next batch; the last one of an epoch may be smaller.
    ///
    /// # Errors
    /// [`LearnError::NotFinite`] and [`LearnError::Exploded`] name the number that diverged; the trainer is unusable
    /// then.
    pub fn train_batch(&mut self) -> Result<SkillMetrics, LearnError> {
        let end = (self.next + self.config.batch).min(self.windows.len());
        let windows = self.windows[self.next..end].to_vec();
        let metrics = update_on(&self.device.plain(), || self.step(&windows))?;
        self.sums.add(&metrics);
        self.next = end;
        if end == self.windows.len() {
            self.epoch += 1;
            self.next = 0;
            let means = std::mem::take(&mut self.sums).mean(&metrics);
            self.last_epoch = SkillMetrics { held_out: self.measure_held_out()?, ..means };
            self.windows = self.cut_windows(self.epoch)?;
        }
        Ok(metrics)
    }

    /// Trains to the end of the running epoch and returns the means over its batches, or `None` if `progress`, which
    /// is called after each batch, stopped it. A later call continues from there.
    ///
    /// # Errors
    /// As [`Self::train_batch`].
    pub fn train_epoch(
        &mut self,
        progress: &mut dyn FnMut(SkillProgress) -> ControlFlow<()>,
    ) -> Result<Option<SkillMetrics>, LearnError> {
        let epoch = self.epoch;
        let batches = self.batches_per_epoch();
        loop {
            let batch = self.batches_done() + 1;
            let metrics = self.train_batch()?;
            let go_on = progress(SkillProgress { epoch, batch, batches, metrics });
            if self.epoch != epoch {
                return Ok(Some(self.last_epoch));
            }
            if go_on.is_break() {
                return Ok(None);
            }
        }
    }

    /// Returns the present model; with [`SkillConfig::patience`] the best one.
    pub fn model(&self) -> SkillModel {
        SkillModel::new(self.description(), &self.nets_of_model(), self.stats.clone(), self.device)
            .with_demos(self.dataset.seen.as_deref().cloned())
    }

    pub(super) fn cut_windows(&self, epoch: u64) -> Result<Vec<Window>, LearnError> {
        self.dataset.windows(self.config.window, self.config.windows, &self.streams, epoch)
    }

    pub(super) fn description(&self) -> SkillDescription {
        SkillDescription {
            config: self.config.clone(),
            observation: self.dataset.observation,
            action_space: self.dataset.space,
        }
    }

    /// Returns the trained model.
    pub fn into_model(self) -> SkillModel {
        self.model()
    }

    fn step(&mut self, windows: &[Window]) -> Result<SkillMetrics, LearnError> {
        let mut noise = self.streams.stream("skill.noise", self.adam.steps());
        let mut changes = self.streams.stream("skill.augment", self.adam.steps());
        let (forward, actions) = self.forward_of(&self.dataset, windows, Some(&mut changes), &mut noise)?;
        let loss = skill_loss(&forward, &self.config);
        let accuracy = accuracy(&forward.decoded, &actions)?;
        let state_error = self.state_error(&self.dataset, windows, &forward)?;
        let objective = match &state_error {
            Some(error) => loss.total + error.clone() * self.config.state_weight,
            None => loss.total,
        };
        let mut parts = vec![&objective, &loss.nll, &loss.kl, &loss.latent_norm];
        parts.extend(&state_error);
        // One allocation, and one wait for a graphics card.
        let numbers = host(Tensor::cat(parts.into_iter().map(|part| part.clone().inner()).collect(), 0))?;
        let [total, nll, kl, latent_norm, ref rest @ ..] = numbers[..] else {
            return Err(LearnError::Device(format!("{} losses instead of 4", numbers.len())));
        };
        let state_error = rest.first().copied();
        let steps = self.adam.steps();
        for (name, value) in [("nll", nll), ("kl", kl), ("loss", total)] {
            check_loss(name, value, steps)?;
        }
        let grad_norm = self.descend(objective)?;
        Ok(SkillMetrics { loss: total, nll, kl, latent_norm, accuracy, grad_norm, state_error, held_out: None })
    }

    /// Returns the learning rate of the next batch.
    fn lr(&self) -> f64 {
        self.config.lr_at(self.epoch as f64 + self.next as f64 / self.windows.len() as f64)
    }

    /// Computes the gradient, clips it, and does one step of Adam; returns the norm before clipping.
    fn descend(&mut self, loss: Tensor<1>) -> Result<f32, LearnError> {
        let (lr, max_norm, steps) = (self.lr(), self.config.max_grad_norm, self.adam.steps());
        if is_host(&self.device.plain()) {
            let grads = NamedGrads::take(&mut self.nets, "", loss.backward())?;
            let (norm, scale) = grads.clip_factor(max_norm, steps)?;
            self.adam.step(&mut self.nets, "", &grads, lr, scale)?;
            return Ok(norm as f32);
        }
        let norm = scalar(self.adam.step_on_device(&mut self.nets, loss.backward(), lr, max_norm))?;
        let lost = || LearnError::NotFinite { tensor: "gradient".to_owned(), steps: Some(steps) };
        norm.is_finite().then_some(norm).ok_or_else(lost)
    }

    /// Runs the networks on windows of `dataset`, with draws of skills from `noise`; images are augmented if
    /// `changes` are given.
    pub(super) fn forward_of(
        &self,
        dataset: &Dataset,
        windows: &[Window],
        changes: Option<&mut ChaCha8Rng>,
        noise: &mut ChaCha8Rng,
    ) -> Result<(SkillForward, Actions), LearnError> {
        let (batch, steps) = (windows.len(), self.config.window);
        let (input, space) = (self.config.action_input, dataset.space);
        let device = self.device.plain();
        let (mut observations, actions) = dataset.gather(windows, steps)?;
        if let (Some(stats), Observations::Vector(values)) = (&self.stats, &mut observations) {
            *values = stats.normalize(values);
        }
        if let (Observations::Image(pixels), ObsKind::Image(shape), Some(changes)) =
            (&mut observations, &dataset.observation, changes)
            && !self.config.augment.is_empty()
        {
            let all: Vec<usize> = (0..steps * batch).collect();
            *pixels = augmented(pixels, shape, &all, &self.config.augment, changes);
        }
        let states = ObsBatch::new(observations, &dataset.observation, &device);
        let encoded = matrix(input.encode(&actions, space)?, steps * batch, input.width(space), &device);
        let noise = (0..batch * self.config.latent).map(|_| normal(noise)).collect();
        let noise = matrix(noise, batch, self.config.latent, &device);
        let rows = ActionBatch::new(&actions, &device);
        let forward = self.nets.forward(&states, &rows, encoded, noise, steps)?;
        Ok((forward, actions))
    }
}

impl SkillTrainer {
    /// Returns the squared error of the predicted state of `windows` of `dataset`, `[1]`, if it is predicted.
    pub(super) fn state_error(
        &self,
        dataset: &Dataset,
        windows: &[Window],
        forward: &SkillForward,
    ) -> Result<Option<Tensor<1>>, LearnError> {
        let (Some(heads), Some(states), Some(stats)) = (&self.nets.state_heads, &dataset.states, &self.state_stats)
        else {
            return Ok(None);
        };
        let steps = self.config.window;
        let (Observations::Vector(values), _) = states.gather(windows, steps)? else {
            return Err(LearnError::Config("states are vectors".to_owned()));
        };
        let rows = steps * windows.len();
        let states = matrix(stats.normalize(&values), rows, states.obs_dim(), &self.device.plain());
        Ok(Some(heads.error(forward, &states)))
    }
}
