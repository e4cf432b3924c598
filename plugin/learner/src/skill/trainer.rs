//! Training of the skill model.

use crate::{
    Actions, DeviceKind, FileError, LearnError, ObsKind, Observations,
    device::update_on,
    file::{FileKind, TensorFile},
    nn::{
        ActionBatch, Adam, AdamConfig, Dist, FlatGrads, HostDist, NamedGrads, ObsBatch, argmax, check_loss, frozen,
        host, matrix, scalar, tracked,
    },
    norm::{ObsStats, put_obs_stats, take_obs_stats},
    observation::augmented,
    rng::{ChaCha8Rng, Streams, normal, shuffle},
    skill::{
        Dataset, SkillConfig, SkillDescription, SkillForward, SkillModel, SkillNets, StateHeads, Window,
        nets::predicted_numbers, skill_loss,
    },
};
use burn::tensor::Tensor;
use playbot_kernels::host_numbers::is_host;
use serde::{Deserialize, Serialize};
use std::{collections::BTreeSet, ops::ControlFlow, path::Path, sync::Arc};

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
        if let Some(numbers) = predicted_numbers(&config, &dataset) {
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
            state_stats: dataset.states.as_ref().and_then(|states| states.stats(&[])),
            stats: if config.norm_obs { dataset.stats(config.entities.blocks()).map(Arc::new) } else { None },
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
        let grads = FlatGrads::take(&mut self.nets, loss.backward());
        let norm = scalar(self.adam.step_on_device(&mut self.nets, grads, lr, max_norm))?;
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
        Ok((forward.restricted(&dataset.legal_of(windows, steps), dataset.space, &rows, &device)?, actions))
    }

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

// Held-out demonstrations, which show when a skill model begins to overfit.

/// Metrics of a skill model on held-out demonstrations: means over their windows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeldOutMetrics {
    /// The whole loss.
    pub loss: f32,
    /// Negative log-likelihood of a window's actions, in nats.
    pub nll: f32,
    /// KL from the encoder to the prior, in nats.
    pub kl: f32,
    /// As [`SkillMetrics::state_error`].
    pub state_error: Option<f32>,
}

/// Held-out demonstrations, with a fixed set of windows.
#[derive(Debug)]
pub(super) struct HeldOut {
    dataset: Dataset,
    windows: Vec<Window>,
}

/// The networks after the best epoch on the held-out demonstrations.
#[derive(Clone, Debug)]
pub(super) struct Best {
    /// Epochs done by then.
    pub(super) epoch: u64,
    /// The NLL on them.
    pub(super) nll: f32,
    pub(super) nets: SkillNets,
}

impl Dataset {
    /// Returns the episodes to learn from and the held-out ones. The held-out ones are all episodes of a share of the
    /// levels, which is drawn from `streams`, at least one. Whole levels are held out because episodes of the same
    /// level are alike.
    ///
    /// # Errors
    /// [`LearnError::Config`] if no episode would be left to learn from.
    pub(super) fn without_held_out(
        self,
        config: &SkillConfig,
        streams: &Streams,
    ) -> Result<(Self, Option<HeldOut>), LearnError> {
        if config.held_out == 0.0 {
            return Ok((self, None));
        }
        let distinct: BTreeSet<usize> = self.levels.iter().copied().collect();
        // With a single level there are only episodes to choose from.
        let groups = if distinct.len() > 1 { self.levels.to_vec() } else { (0..self.episodes.len()).collect() };
        let mut order: Vec<usize> = groups.iter().copied().collect::<BTreeSet<_>>().into_iter().collect();
        let (all, what) = (order.len(), if distinct.len() > 1 { "levels" } else { "episodes" });
        let count = ((config.held_out * all as f64).round() as usize).max(1);
        if count >= all {
            let text = format!(
                "skill held_out takes {count} of {all} {what}, which leaves none to learn from: record more, or set \
                 it to 0"
            );
            return Err(LearnError::Config(text));
        }
        shuffle(&mut order, &mut streams.stream("skill.held_out", 0));
        let apart: BTreeSet<usize> = order[..count].iter().copied().collect();
        let some = |is_apart: bool| {
            let numbers = (0..groups.len()).filter(|&episode| apart.contains(&groups[episode]) == is_apart);
            self.subset(&numbers.collect::<Vec<_>>())
        };
        let dataset = some(true);
        let windows = dataset.windows(config.window, config.windows, streams, 0)?;
        Ok((some(false), Some(HeldOut { dataset, windows })))
    }
}

impl SkillTrainer {
    /// Measures the networks on the held-out demonstrations, if there are any, and keeps the networks if their NLL is
    /// the lowest so far. The rest of the loss does not count: it measures how skills are told apart, not how well
    /// they are played. The draws of skills are the same each time.
    pub(super) fn measure_held_out(&mut self) -> Result<Option<HeldOutMetrics>, LearnError> {
        let Some(held_out) = &self.held_out else { return Ok(None) };
        let mut sums = [0.0f64; 4];
        for (number, windows) in held_out.windows.chunks(self.config.batch).enumerate() {
            let mut rng = self.streams.stream("skill.held_out.noise", number as u64);
            let (forward, _) = self.forward_of(&held_out.dataset, windows, None, &mut rng)?;
            let loss = skill_loss(&forward, &self.config);
            let mut parts = vec![loss.total, loss.nll, loss.kl];
            parts.extend(self.state_error(&held_out.dataset, windows, &forward)?);
            let numbers = host(Tensor::cat(parts.into_iter().map(Tensor::inner).collect(), 0))?;
            sums.iter_mut().zip(numbers).for_each(|(sum, x)| *sum += f64::from(x) * windows.len() as f64);
        }
        let [loss, nll, kl, state_error] = sums.map(|sum| (sum / held_out.windows.len() as f64) as f32);
        if !loss.is_finite() {
            return Err(LearnError::NotFinite {
                tensor: "the loss on demonstrations kept apart".to_owned(),
                steps: None,
            });
        }
        if self.config.patience.is_some() && self.best.as_ref().is_none_or(|best| nll < best.nll) {
            let nets = SkillNets { state_heads: None, ..frozen(&self.nets) };
            self.best = Some(Best { epoch: self.epoch, nll, nets });
        }
        let state_error = self.nets.state_heads.as_ref().map(|_| state_error);
        Ok(Some(HeldOutMetrics { loss, nll, kl, state_error }))
    }

    /// Returns whether [`SkillConfig::patience`] is exhausted: more epochs would overfit.
    pub fn is_over(&self) -> bool {
        let best = self.best.as_ref().zip(self.config.patience);
        best.is_some_and(|(best, patience)| self.epoch >= best.epoch + patience as u64)
    }

    /// Returns the epoch after which the networks had the least NLL on the held-out demonstrations; `None` without
    /// any.
    pub fn best_epoch(&self) -> Option<u64> {
        self.best.as_ref().map(|best| best.epoch)
    }

    /// Returns the NLL on the held-out demonstrations after [`Self::best_epoch`].
    pub fn best_nll(&self) -> Option<f32> {
        self.best.as_ref().map(|best| best.nll)
    }

    /// Returns the networks of the model: the best ones, or the present ones.
    pub(super) fn nets_of_model(&self) -> SkillNets {
        self.best.as_ref().map_or_else(|| self.nets.clone(), |best| tracked(&best.nets))
    }
}

impl SkillMetrics {
    /// Returns the NLL on held-out demonstrations, if there are any.
    pub fn held_out_nll(&self) -> Option<f32> {
        self.held_out.map(|held_out| held_out.nll)
    }
}

// Metrics of a skill model's training.

/// Metrics of one batch, or their mean over an epoch's batches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SkillMetrics {
    /// The whole loss.
    pub loss: f32,
    /// Negative log-likelihood of a window's actions, in nats (see [`crate::skill::Reduction`]).
    pub nll: f32,
    /// KL from the encoder to the prior, in nats.
    pub kl: f32,
    /// Mean Euclidean norm of the decoder's latent.
    pub latent_norm: f32,
    /// Share of steps whose action is the decoder's most likely one; `None` for continuous actions.
    pub accuracy: Option<f32>,
    /// Norm of the gradient before clipping.
    pub grad_norm: f32,
    /// Squared error of the predicted state, the mean over its numbers and summed over a window, with
    /// [`state_weight`](crate::skill::SkillConfig::state_weight). It starts near the number of steps of a window plus
    /// 1.
    pub state_error: Option<f32>,
    /// Metrics of an epoch's networks on held-out demonstrations; `None` for a single batch, and without any.
    pub held_out: Option<HeldOutMetrics>,
}

/// Sums over the running epoch's batches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct MetricSums {
    pub(super) count: usize,
    pub(super) total: [f64; 7],
}

impl MetricSums {
    pub(super) fn add(&mut self, m: &SkillMetrics) {
        let optional = [m.accuracy, m.state_error].map(|x| x.unwrap_or(0.0));
        let values = [m.loss, m.nll, m.kl, m.latent_norm, optional[0], m.grad_norm, optional[1]];
        self.count += 1;
        self.total.iter_mut().zip(values).for_each(|(sum, x)| *sum += f64::from(x));
    }

    /// Returns the means over those metrics that `last`, the last batch, has.
    pub(super) fn mean(self, last: &SkillMetrics) -> SkillMetrics {
        let [loss, nll, kl, latent_norm, hits, grad_norm, state_error] =
            self.total.map(|sum| (sum / self.count.max(1) as f64) as f32);
        let (accuracy, state_error) = (last.accuracy.map(|_| hits), last.state_error.map(|_| state_error));
        SkillMetrics { loss, nll, kl, latent_norm, accuracy, grad_norm, state_error, held_out: None }
    }
}

/// Returns the share of the choices that are the most likely ones; `None` for actions without choices.
pub(super) fn accuracy(decoded: &Dist, actions: &Actions) -> Result<Option<f32>, LearnError> {
    if matches!(decoded, Dist::Gaussian { .. }) {
        return Ok(None);
    }
    let HostDist { space, head, .. } = decoded.clone().to_host()?;
    let (mut hits, mut count) = (0, 0);
    for (row, head) in head.chunks_exact(space.dim().max(1)).enumerate() {
        for (at, &option) in space.choices().ranges().zip(actions.chosen(row)) {
            hits += usize::from(argmax(&head[at]) == option);
            count += 1;
        }
    }
    Ok((count > 0).then(|| hits as f32 / count as f32))
}

// A trainer's complete state in one file.

const FILE: FileKind = FileKind { name: "skill checkpoint", version: 1 };

/// The JSON in the file's header.
///
/// The trainer's generators are streams of `seed` numbered by the epoch and by `adam_steps`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    skill: SkillDescription,
    seed: u64,
    epoch: u64,
    windows_done: usize,
    adam_steps: u64,
    batches: usize,
    demo_episodes: usize,
    demo_steps: usize,
    /// A hash of the demonstrations; the first checkpoints had none.
    #[serde(default)]
    demo_hash: Option<u64>,
    /// The best epoch on the held-out demonstrations, and the NLL there; the first checkpoints had the whole loss.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    best: Option<(u64, f32)>,
}

impl SkillTrainer {
    /// Writes the complete state except the demonstrations, so that training continues bit for bit. The file gets a
    /// temporary name first, so a checkpoint is complete or absent.
    ///
    /// # Errors
    /// [`FileError::Io`] if it cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let header = Header {
            skill: self.description(),
            seed: self.streams.seed(),
            epoch: self.epoch,
            windows_done: self.next,
            adam_steps: self.adam.steps,
            batches: self.sums.count,
            demo_episodes: self.extent.0,
            demo_steps: self.extent.1,
            demo_hash: Some(self.fingerprint),
            best: self.best.as_ref().map(|best| (best.epoch, best.nll)),
        };
        let mut file = TensorFile::new(path, FILE, &header)?;
        file.put_network("", &self.nets)?;
        file.put_adam(&self.adam)?;
        if let Some(stats) = &self.stats {
            put_obs_stats(&mut file, "obs_norm", stats);
        }
        if let Some(best) = &self.best {
            file.put_network("best", &best.nets)?;
        }
        file.put_f64("epoch_sums", &self.sums.total);
        file.write()
    }

    /// Reads a file that [`Self::save`] wrote; `dataset` must be the one of that run.
    ///
    /// # Errors
    /// [`FileError`] describes the problem of the file, or does not fit the demonstrations.
    pub fn load(path: &Path, dataset: Dataset, device: DeviceKind) -> Result<Self, FileError> {
        let mut file = TensorFile::read(path)?;
        let header: Header = file.header(FILE)?;
        device.check().map_err(|e| file.learner(e))?;
        let skill = header.skill;
        for (what, expected, found) in [
            ("episodes of the demonstrations", header.demo_episodes, dataset.episodes()),
            ("steps of the demonstrations", header.demo_steps, dataset.steps()),
        ] {
            LearnError::check(what, expected, found).map_err(|e| file.learner(e))?;
        }
        if skill.observation != dataset.observation() {
            let (reads, found) = (skill.observation, dataset.observation());
            return Err(file.format(format!("reads {reads}, the demonstrations are {found}")));
        }
        if skill.action_space != dataset.action_space() {
            return Err(file.format(format!(
                "acts with {}, the demonstrations with {}",
                skill.action_space,
                dataset.action_space()
            )));
        }
        let mut nets = SkillNets::stored(&skill, &mut file, "", &device.plain())?;
        if let Some(numbers) = predicted_numbers(&skill.config, &dataset) {
            let features = skill.config.cnn.features();
            let heads = StateHeads::build(&mut file.params(&device.plain()), "state_heads", features, numbers)?;
            nets.state_heads = Some(heads);
        }
        let best = match header.best {
            None => None,
            Some((epoch, nll)) => {
                let nets = SkillNets::stored(&skill, &mut file, "best", &device.plain())?;
                Some(Best { epoch, nll, nets })
            }
        };
        let trainer = Self::with_nets(skill.config, dataset, &nets, header.seed, device);
        let mut trainer = trainer.map_err(|e| file.learner(e))?;
        if header.demo_hash.is_some_and(|hash| hash != trainer.fingerprint) {
            let text = "the demonstrations are not those of this run: their episodes differ in content";
            return Err(file.format(text.to_owned()));
        }
        file.take_adam(&mut trainer.adam, "", &mut trainer.nets, header.adam_steps)?;
        if let Some(stats) = &mut trainer.stats {
            *stats = Arc::new(take_obs_stats(&mut file, "obs_norm", trainer.dataset.obs_dim())?);
        }
        trainer.sums.count = header.batches;
        // Older checkpoints have no error of states.
        let sums = file.take_f64("epoch_sums", None)?;
        trainer.sums.total.iter_mut().zip(sums).for_each(|(total, sum)| *total = sum);
        trainer.best = best;
        trainer.epoch = header.epoch;
        let windows = trainer.cut_windows(header.epoch);
        trainer.windows = windows.map_err(|e| file.learner(e))?;
        if header.windows_done >= trainer.windows.len() {
            return Err(file.format("is behind the end of its epoch".to_owned()));
        }
        trainer.next = header.windows_done;
        file.finish()?;
        Ok(trainer)
    }
}
