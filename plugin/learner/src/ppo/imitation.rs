//! Imitation: the policy is fitted to labelled observations, by the likelihood of the labels.

use crate::{
    Actions, FileError, LearnError, Learner, LearnerMetrics, MemoryKind, ObsKind, Observations, Policy, PolicySpec,
    Rollout,
    device::update_on,
    file::{FileKind, TensorFile},
    legal::{free_rows, logit_offsets},
    nn::{ActionBatch, NamedGrads, ParamVisitor, Parameters, finite},
    policy::{InputBuilder, LogStd, Recall},
    ppo::{
        PpoLearner,
        sequences::{Sequence, recall, rows_of, sequences},
    },
    rng::{ChaCha8Rng, shuffle},
    settings,
    settings::{Range, Reader},
    skill::{Dataset, DatasetEpisode},
};
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};
use std::path::Path;

settings! {
    /// Imitation of recordings, or of a demonstrator that is asked in each state (Ross et al. 2011, "A reduction of
    /// imitation learning and structured prediction to no-regret online learning", DAgger).
    #[derive(Clone, Debug, PartialEq)]
    pub struct ImitationConfig in "imitation", read by &[Reader::IMITATION];

    /// True if the demonstrator is asked in the states that the policy visits. Otherwise recordings are imitated.
    dagger: bool = false;
    /// Most rounds. Each labels steps, if the demonstrator is asked, and then learns from all of them.
    rounds: u64 = 10, in Range::COUNT;
    /// Steps that are labelled in a round, over all arenas together; rounded up to whole ticks of all.
    steps: u64 = 10_000, in Range::COUNT;
    /// Least ticks of an arena in a round: fewer arenas play if there are too few steps for all. Rounds begin with new
    /// episodes, so this has to be longer than an episode: else its end is never seen.
    ticks: u64 = 1000, in Range::COUNT;
    /// Share of the actions that the demonstrator takes in round n, from 0: this number to the power of n. With 1 it takes
    /// all of them in every round, which is imitation alone.
    beta: f64 = 0.5, in Range::SHARE;
    /// Passes over all labelled steps in a round.
    epochs: usize = 4, in Range::PASSES;
    /// Steps of a minibatch.
    batch: usize = 256, in Range::COUNT;
    /// Learning rate of Adam.
    lr: f64 = 1e-3, in Range::RATE;
    /// Share of the training levels, the last ones, on which nothing is labelled. They say which round is the best.
    held_out: f64 = 0.2, in Range::SHARE;
    /// Most of these levels that are played after a round.
    played: u64 = 32, in Range::COUNT;
    /// Rounds without a better result on them after which the imitation ends.
    patience: u64 = 4, in Range::COUNT;
}

/// Bound of the gradient's Euclidean norm.
const MAX_GRAD_NORM: f64 = 1.0;

/// Smallest ln σ of a Gaussian policy. The likelihood of labels without noise would drive it down without end.
const LOWEST_LOG_STD: f32 = -3.0;

/// Observations, each with the action that a demonstrator would take.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledSteps {
    /// One row per step.
    pub obs: Observations,
    /// The labels.
    pub actions: Actions,
    /// Masks of the actions, row-major; empty if all are legal.
    pub legal: Vec<bool>,
    /// The rows that begin an episode, in ascending order. Rows up to the next one follow each other tick by tick. Empty
    /// if that is not known, and then no policy with memory can learn from them.
    pub begins: Vec<usize>,
}

const FILE: FileKind = FileKind { name: "labelled steps", version: 1 };

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    spec: PolicySpec,
    rows: usize,
    is_masked: bool,
    /// Rows that begin an episode; the first files had none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    begins: Vec<usize>,
}

impl LabelledSteps {
    /// Creates an empty set for policies of `spec`.
    pub fn empty(spec: &PolicySpec) -> Self {
        Self {
            obs: Observations::empty(&spec.obs),
            actions: Actions::empty(&spec.action_space),
            legal: Vec::new(),
            begins: Vec::new(),
        }
    }

    /// Returns all steps of recordings, labelled by the recorded actions.
    ///
    /// # Errors
    /// [`LearnError`] if the episodes are of several kinds, which a data set refuses.
    pub fn of(dataset: &Dataset) -> Result<Self, LearnError> {
        let spec = PolicySpec { obs: dataset.observation(), latent: 0, action_space: dataset.action_space() };
        let mut all = Self::empty(&spec);
        for (number, episode) in dataset.episodes.iter().enumerate() {
            let legal = dataset.legal.get(number).map_or(Vec::new(), |legal| legal.to_vec());
            let DatasetEpisode { observations, actions } = &**episode;
            let begins = if actions.is_empty() { Vec::new() } else { vec![0] };
            all.extend(&Self { obs: observations.clone(), actions: actions.clone(), legal, begins }, &spec)?;
        }
        Ok(all)
    }

    /// Returns the number of steps.
    pub fn len(&self) -> usize {
        self.actions.len()
    }

    /// Returns whether there are no steps.
    pub fn is_empty(&self) -> bool {
        self.actions.is_empty()
    }

    /// Adds more steps behind these. Steps without masks get masks that allow all, if others have some.
    ///
    /// # Errors
    /// [`LearnError`] if observations or actions are of another kind.
    pub fn extend(&mut self, more: &Self, spec: &PolicySpec) -> Result<(), LearnError> {
        let (before, rows) = (self.len(), more.len());
        self.obs.push(more.obs.as_slice())?;
        self.actions.extend_rows(&more.actions, 0, rows)?;
        crate::legal::extend(&mut self.legal, before, &more.legal, rows, spec.action_space.mask_width());
        self.begins.extend(more.begins.iter().map(|row| before + row));
        Ok(())
    }

    /// Writes them into a file, in one step.
    ///
    /// # Errors
    /// [`FileError::Io`] if it cannot be written.
    pub fn save(&self, path: &Path, spec: &PolicySpec) -> Result<(), FileError> {
        let (is_masked, begins) = (!self.legal.is_empty(), self.begins.clone());
        let header = Header { spec: *spec, rows: self.len(), is_masked, begins };
        let mut file = TensorFile::new(path, FILE, &header)?;
        match &self.obs {
            Observations::Vector(values) => file.put("obs", &[values.len()], values),
            Observations::Image(pixels) => file.put_bytes("obs", &[pixels.len()], pixels),
        }
        match &self.actions {
            Actions::Discrete(indices) => file.put_u32("actions", indices),
            Actions::Continuous { values, .. } => file.put("actions", &[values.len()], values),
            Actions::Mixed { options, values, .. } => {
                file.put_u32("options", options);
                file.put("numbers", &[values.len()], values);
            }
        }
        if header.is_masked {
            file.put_flags("legal", &self.legal);
        }
        file.write()
    }

    /// Reads a file that [`Self::save`] wrote for policies of `spec`.
    ///
    /// # Errors
    /// [`FileError`] describes the problem of the file.
    pub fn load(path: &Path, spec: &PolicySpec) -> Result<Self, FileError> {
        let mut file = TensorFile::read(path)?;
        let header: Header = file.header(FILE)?;
        if header.spec != *spec {
            return Err(file.format(format!("its steps are of {:?}, and {spec:?} is needed", header.spec)));
        }
        let (rows, space) = (header.rows, spec.action_space);
        let is_ordered = header.begins.is_sorted_by(|one, other| one < other);
        if !is_ordered || header.begins.last().is_some_and(|&row| row >= rows) {
            return Err(file.format("its episodes do not begin in ascending rows".to_owned()));
        }
        let product = |of: &TensorFile, what: &str, width: usize| match (rows, width) {
            (0, _) | (_, 0) => Ok(0),
            (rows, width) => of.product(what, &[rows, width]),
        };
        let numbers = product(&file, "obs", spec.obs.numbers())?;
        let obs = match spec.obs {
            ObsKind::Vector(_) => Observations::Vector(file.take("obs", &[numbers])?),
            ObsKind::Image(_) => Observations::Image(file.take_bytes("obs", &[numbers])?),
        };
        let mut actions = Actions::empty(&spec.action_space);
        let of_numbers = product(&file, "actions", space.numbers())?;
        match &mut actions {
            Actions::Discrete(indices) => *indices = file.take_u32("actions", rows)?,
            Actions::Continuous { values, .. } => *values = file.take("actions", &[of_numbers])?,
            Actions::Mixed { choices, options, values, .. } => {
                let of_choices = product(&file, "options", *choices)?;
                *options = file.take_u32("options", of_choices)?;
                *values = file.take("numbers", &[of_numbers])?;
            }
        }
        spec.action_space.check(&actions).map_err(|error| file.learner(error))?;
        let of_mask = product(&file, "legal", space.mask_width())?;
        let legal = if header.is_masked { file.take_flags("legal", of_mask)? } else { Vec::new() };
        file.finish()?;
        Ok(Self { obs, actions, legal, begins: header.begins })
    }
}

struct ZeroMoments<'a>(&'a mut crate::nn::Adam);

impl ParamVisitor for ZeroMoments<'_> {
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>) {
        let (shape, numbers) = (tensor.dims().to_vec(), tensor.dims().iter().product());
        self.0.restore(name.to_owned(), shape, vec![0.0; numbers], vec![0.0; numbers]);
    }
}

impl PpoLearner {
    /// Fits the policy to `steps`, of which the last `fresh` are new: passes over all of them in minibatches, each with a
    /// step of Adam on the mean negative log-likelihood of the labels. The critic stays as it is.
    ///
    /// # Errors
    /// [`LearnError`] if there are no steps, they do not fit, or the loss is not finite.
    pub fn imitate(
        &mut self,
        steps: &LabelledSteps,
        fresh: usize,
        config: &ImitationConfig,
    ) -> Result<LearnerMetrics, LearnError> {
        update_on(&self.base.device.plain(), || self.imitate_here(steps, fresh, config))
    }

    fn imitate_here(
        &mut self,
        steps: &LabelledSteps,
        fresh: usize,
        config: &ImitationConfig,
    ) -> Result<LearnerMetrics, LearnError> {
        let (spec, n) = (self.base.spec, steps.len());
        if n == 0 {
            return Err(LearnError::Config("there are no labelled steps to imitate".to_owned()));
        }
        steps.obs.as_slice().check("labelled observations", &spec.obs, n)?;
        spec.action_space.check(&steps.actions)?;
        if let (Some(normalizer), Observations::Vector(values)) = (&mut self.base.observations, &steps.obs) {
            let first = n.saturating_sub(fresh) * spec.obs.numbers();
            normalizer.update(&values[first..]);
        }
        if self.adam.steps == 0 {
            // A checkpoint holds the moments of all parameters, also of those that do not learn here.
            self.nets.critic.visit("critic", &mut ZeroMoments(&mut self.adam));
        }
        let (stats, device) = (self.base.obs_stats(), self.base.device.plain());
        let inputs =
            InputBuilder { z: &[], latent: 0, obs: steps.obs.as_slice(), kind: &spec.obs, stats: stats.as_deref() };
        let mut rng = self.base.streams.stream("imitation.minibatches", self.base.updates);
        let mut order = Order::new(steps, spec, self.config.memory)?;
        let (mut last_pass, mut norms, mut count) = (0.0, 0.0, 0.0);
        for pass in 0..config.epochs {
            if let Order::Sequences { played, .. } = &mut order {
                played.memory = remembered(&self.policy(), steps)?;
            }
            for minibatch in order.minibatches(config.batch, &mut rng) {
                let rows = &minibatch.rows[..];
                let recall = order.recall(&minibatch, &inputs, &device);
                let joined = self.nets.actor.join(&inputs.input(rows, &device))?;
                let features = self.nets.actor.recall(joined, recall.as_ref())?;
                let offsets = logit_offsets(&steps.legal, rows, &spec.action_space, &device);
                let free = free_rows(&steps.legal, rows, &spec.action_space, &device);
                let dist = self.nets.actor.forward_legal(features, offsets.as_ref()).with_free(free.as_ref());
                let labels = ActionBatch::new(&steps.actions.gather(rows), &device);
                let loss = dist.log_prob(&labels)?.neg().mean();
                let nll = finite("imitation_loss", &loss, self.adam.steps)?;
                if pass + 1 == config.epochs {
                    last_pass += nll * rows.len() as f64 / n as f64;
                }
                let grads = NamedGrads::take(&mut self.nets.actor, "actor", loss.backward())?;
                let (norm, scale) = grads.clip_factor(MAX_GRAD_NORM, self.adam.steps)?;
                (norms, count) = (norms + norm, count + 1.0);
                self.adam.step(&mut self.nets.actor, "actor", &grads, config.lr, scale)?;
                if let LogStd::Vector(log_std) = &mut self.nets.actor.log_std {
                    *log_std = log_std.clone().inner().clamp_min(LOWEST_LOG_STD).autodiff().require_grad();
                }
            }
        }
        self.base.updates += 1;
        Ok(LearnerMetrics::new(vec![
            ("losses/imitation_loss", last_pass),
            ("losses/grad_norm", norms / count),
            ("imitation/labelled_steps", n as f64),
        ]))
    }
}

// The order in which labelled steps are learned from.

/// A minibatch: its rows, and the sequences that they are for a policy with memory.
struct Labelled {
    rows: Vec<usize>,
    sequences: Vec<Sequence>,
}

/// The rows of labelled steps, for minibatches.
#[derive(Debug)]
enum Order {
    /// Each by itself.
    Rows(Vec<usize>),
    /// Sequences of so many ticks, for a policy with memory.
    Sequences {
        all: Vec<Sequence>,
        ticks: usize,
        /// The steps as a rollout of one environment, with what is remembered before each.
        played: Box<Rollout>,
    },
}

impl Order {
    /// # Errors
    /// [`LearnError::Config`] if the policy remembers and the episodes of the steps are not known.
    fn new(steps: &LabelledSteps, spec: PolicySpec, memory: MemoryKind) -> Result<Self, LearnError> {
        let n = steps.len();
        let Some((ticks, _)) = memory.sequences() else { return Ok(Self::Rows((0..n).collect())) };
        if steps.begins.first() != Some(&0) {
            let why = "a policy that remembers is imitated from whole episodes, and the labelled steps do not say where \
                       theirs begin: leave `ppo.memory` at `None`, or record and label anew";
            return Err(LearnError::Config(why.to_owned()));
        }
        let mut terminated = vec![false; n];
        steps.begins.iter().skip(1).for_each(|&row| terminated[row - 1] = true);
        let played = Rollout {
            steps: n,
            terminated,
            truncated: vec![false; n],
            ..Rollout::new(1, spec.obs, 0, &spec.action_space)
        };
        // What is remembered is computed anew before each pass, so that there is no need for a burn-in.
        Ok(Self::Sequences { all: sequences(&played, ticks, 0), ticks, played: Box::new(played) })
    }

    /// Draws the minibatches of a pass, of about so many rows.
    fn minibatches(&mut self, batch: usize, rng: &mut ChaCha8Rng) -> Vec<Labelled> {
        match self {
            Self::Rows(order) => {
                shuffle(order, rng);
                order.chunks(batch).map(|rows| Labelled { rows: rows.to_vec(), sequences: Vec::new() }).collect()
            }
            Self::Sequences { all, ticks, .. } => {
                shuffle(all, rng);
                let parts = all.chunks((batch / *ticks).max(1));
                parts.map(|part| Labelled { rows: rows_of(part, 1), sequences: part.to_vec() }).collect()
            }
        }
    }

    /// Returns how the rows of a minibatch are remembered, for a policy with memory.
    fn recall(&self, minibatch: &Labelled, inputs: &InputBuilder<'_>, device: &Device) -> Option<Recall> {
        match self {
            Self::Rows(_) => None,
            Self::Sequences { played, .. } => Some(recall(&minibatch.sequences, played, inputs, device)),
        }
    }
}

/// Returns what a policy remembers before each of these steps, row after row, if it plays their episodes from the start.
///
/// # Errors
/// As [`Policy::forward`].
fn remembered(policy: &Policy, steps: &LabelledSteps) -> Result<Vec<f32>, LearnError> {
    let (width, numbers, n) = (policy.memory(), policy.obs_dim(), steps.len());
    let mut before = vec![0.0; n * width];
    if width == 0 {
        return Ok(before);
    }
    let ends = steps.begins.iter().skip(1).copied().chain([n]);
    let episodes: Vec<(usize, usize)> = steps.begins.iter().copied().zip(ends).collect();
    // The last tick of an episode leaves nothing to remember.
    let longest = episodes.iter().map(|(begin, end)| end - begin).max().unwrap_or(0);
    for tick in 0..longest.saturating_sub(1) {
        let rows: Vec<usize> =
            episodes.iter().filter(|(begin, end)| begin + tick + 1 < *end).map(|(begin, _)| begin + tick).collect();
        let mut obs = Observations::with_capacity(&policy.observation(), rows.len());
        for &row in &rows {
            obs.push(steps.obs.row(row, numbers))?;
        }
        let memory: Vec<f32> = rows.iter().flat_map(|row| &before[row * width..(row + 1) * width]).copied().collect();
        let after = policy.forward_remembering(&[], &[], &memory, obs.as_slice(), rows.len())?.memory;
        for (row, after) in rows.iter().zip(after.chunks_exact(width)) {
            before[(row + 1) * width..(row + 2) * width].copy_from_slice(after);
        }
    }
    Ok(before)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ActionSpace, ActionValue, DeviceKind, Learner, PpoConfig, Streams, rng::normal};

    fn spec(action_space: ActionSpace) -> PolicySpec {
        PolicySpec { obs: 2.into(), latent: 0, action_space }
    }

    /// Returns points of the plane, labelled by the side on which they lie.
    fn sides(count: usize, masked: bool) -> LabelledSteps {
        let mut rng = Streams::new(1).stream("points", 0);
        let mut steps = LabelledSteps::empty(&spec(ActionSpace::Discrete(3)));
        for _ in 0..count {
            let point = [normal(&mut rng), normal(&mut rng)];
            steps.obs.push(&point).expect("vectors");
            let side = u32::from(point[0] + point[1] > 0.0);
            steps.actions.push(&ActionValue::Discrete(side)).expect("a choice");
            if masked {
                steps.legal.extend([true, true, false]);
            }
        }
        steps
    }

    fn learner(space: ActionSpace, norm_obs: bool) -> PpoLearner {
        let config = PpoConfig { hidden: vec![32], norm_obs, ..PpoConfig::default() };
        PpoLearner::new(config, spec(space), 3, DeviceKind::Flex).expect("good settings")
    }

    fn right(learner: &PpoLearner, steps: &LabelledSteps) -> f64 {
        let output = learner.policy().forward(&[], steps.obs.as_slice(), steps.len()).expect("finite");
        let equal = (0..steps.len()).filter(|&row| Some(output.greedy(row)) == steps.actions.get(row)).count();
        equal as f64 / steps.len() as f64
    }

    #[test]
    fn a_policy_learns_what_its_demonstrator_does() {
        let config = ImitationConfig { lr: 1e-2, ..ImitationConfig::default() };
        for (masked, norm_obs) in [(false, false), (true, true)] {
            let (steps, mut learner) = (sides(600, masked), learner(ActionSpace::Discrete(3), norm_obs));
            assert!(right(&learner, &steps) < 0.8);
            for _ in 0..8 {
                learner.imitate(&steps, 0, &config).expect("finite");
            }
            assert!(right(&learner, &steps) > 0.97, "{}", right(&learner, &steps));
        }
    }

    #[test]
    fn the_deviation_of_a_continuous_policy_does_not_vanish() {
        let space = ActionSpace::Continuous(1);
        let mut steps = LabelledSteps::empty(&spec(space));
        let mut rng = Streams::new(2).stream("points", 0);
        for _ in 0..200 {
            let point = [normal(&mut rng), normal(&mut rng)];
            steps.obs.push(&point).expect("vectors");
            steps.actions.push(&ActionValue::Continuous(vec![(0.5 * point[0]).clamp(-1.0, 1.0)])).expect("a push");
        }
        let mut learner = learner(space, false);
        let config = ImitationConfig { lr: 3e-2, epochs: 60, batch: 50, ..ImitationConfig::default() };
        learner.imitate(&steps, 200, &config).expect("finite");
        let output = learner.policy().forward(&[], &[1.0, 0.0], 1).expect("finite");
        assert!((output.head[0] - 0.5).abs() < 0.15, "{output:?}");
        assert!((LOWEST_LOG_STD..-1.0).contains(&output.log_std[0]), "{output:?}");
    }

    #[test]
    fn a_saved_imitation_goes_on_bit_for_bit_and_its_critic_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("learner.safetensors");
        let (steps, config) = (sides(100, true), ImitationConfig::default());
        let play = |learner: &PpoLearner| learner.policy().forward(&[], &[0.3, -0.2], 1).expect("finite");
        for norm_obs in [false, true] {
            let mut learner = learner(ActionSpace::Discrete(3), norm_obs);
            let before = play(&learner);
            learner.imitate(&steps, 100, &config).expect("finite");
            learner.save(&path).expect("written");
            let mut loaded = PpoLearner::load(&path, DeviceKind::Flex).expect("readable");
            let next = learner.imitate(&steps, 0, &config).expect("finite");
            assert_eq!(loaded.imitate(&steps, 0, &config).expect("finite"), next);
            assert_eq!(play(&loaded), play(&learner));
            assert_ne!(play(&learner).head, before.head);
            // With a normaliser its weights stay, but its input changes.
            assert_eq!(play(&learner).values == before.values, !norm_obs);
        }
    }

    #[test]
    fn labelled_steps_are_read_as_they_were_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("labels.safetensors");
        let spec = spec(ActionSpace::Discrete(3));
        let mut steps = sides(7, false);
        steps.extend(&sides(5, true), &spec).expect("the same kind");
        assert_eq!((steps.len(), steps.legal.len()), (12, 36));
        steps.save(&path, &spec).expect("written");
        assert_eq!(LabelledSteps::load(&path, &spec).expect("readable"), steps);
        let other = PolicySpec { obs: 3.into(), ..spec };
        assert!(LabelledSteps::load(&path, &other).expect_err("wider").to_string().contains("is needed"));
        let bytes = std::fs::read(&path).expect("readable");
        std::fs::write(&path, &bytes[..bytes.len() - 4]).expect("writable");
        assert!(LabelledSteps::load(&path, &spec).is_err(), "it is cut off");
        let mut learner = learner(ActionSpace::Discrete(3), false);
        let nothing = LabelledSteps::empty(&spec);
        let error = learner.imitate(&nothing, 0, &ImitationConfig::default()).expect_err("no steps").to_string();
        assert!(error.contains("there are no labelled steps to imitate"), "{error}");
    }

    /// Returns episodes whose first observation names the label of their last tick.
    fn cued(episodes: usize) -> LabelledSteps {
        let mut rng = Streams::new(5).stream("cues", 0);
        let mut steps = LabelledSteps::empty(&spec(ActionSpace::Discrete(3)));
        for _ in 0..episodes {
            let right = normal(&mut rng) > 0.0;
            steps.begins.push(steps.len());
            for tick in 0..6 {
                let cue = if right { 1.0 } else { -1.0 };
                steps.obs.push(&[if tick == 0 { cue } else { 0.0 }, tick as f32 / 5.0]).expect("vectors");
                let label = if tick == 5 { u32::from(right) } else { 2 };
                steps.actions.push(&ActionValue::Discrete(label)).expect("a choice");
            }
        }
        steps
    }

    /// Returns the share of the last ticks that a policy gets right.
    fn right_at_the_end(learner: &PpoLearner, steps: &LabelledSteps) -> f64 {
        let policy = learner.policy();
        let memory = remembered(&policy, steps).expect("finite");
        let output = policy.forward_remembering(&[], &[], &memory, steps.obs.as_slice(), steps.len()).expect("finite");
        let ends: Vec<usize> = (5..steps.len()).step_by(6).collect();
        let equal = ends.iter().filter(|&&row| Some(output.greedy(row)) == steps.actions.get(row)).count();
        equal as f64 / ends.len() as f64
    }

    fn with_memory(memory: MemoryKind) -> PpoLearner {
        let config = PpoConfig { hidden: vec![32], memory, ..PpoConfig::default() };
        PpoLearner::new(config, spec(ActionSpace::Discrete(3)), 3, DeviceKind::Flex).expect("good settings")
    }

    #[test]
    fn a_policy_with_memory_learns_what_depends_on_an_earlier_tick() {
        let (steps, others) = (cued(200), cued(300));
        let config = ImitationConfig { lr: 1e-2, epochs: 60, batch: 120, ..ImitationConfig::default() };
        let right = |memory| {
            let mut learner = with_memory(memory);
            learner.imitate(&steps, 0, &config).expect("finite");
            right_at_the_end(&learner, &others)
        };
        let [none, gru, stack] =
            [MemoryKind::None, MemoryKind::Gru { hidden: 16, sequence: 6, burn_in: 0 }, MemoryKind::Stack { ticks: 6 }]
                .map(right);
        assert!((0.3..0.7).contains(&none), "without memory the cue is gone: {none}");
        assert!(stack > 0.95, "{stack}");
        assert!(gru > 0.95, "{gru}");
    }

    #[test]
    fn what_is_remembered_is_what_a_policy_would_remember_in_play() {
        let (steps, learner) = (cued(3), with_memory(MemoryKind::Gru { hidden: 4, sequence: 6, burn_in: 0 }));
        let (policy, before) = (learner.policy(), remembered(&learner.policy(), &steps).expect("finite"));
        for episode in 0..3 {
            let mut memory = vec![0.0; 4];
            for row in episode * 6..episode * 6 + 6 {
                assert_eq!(before[row * 4..row * 4 + 4], memory, "row {row}");
                let output = policy.forward_remembering(&[], &[], &memory, steps.obs.row(row, 2), 1);
                memory = output.expect("finite").memory;
            }
        }
    }

    #[test]
    fn steps_whose_episodes_are_not_known_are_refused_by_a_memory() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("labels.safetensors");
        let spec = spec(ActionSpace::Discrete(3));
        let mut steps = cued(2);
        steps.save(&path, &spec).expect("written");
        assert_eq!(LabelledSteps::load(&path, &spec).expect("readable"), steps);
        steps.begins = vec![6, 0];
        steps.save(&path, &spec).expect("written");
        let error = LabelledSteps::load(&path, &spec).expect_err("in no order").to_string();
        assert!(error.contains("ascending rows"), "{error}");
        steps.begins.clear();
        let mut learner = with_memory(MemoryKind::Stack { ticks: 2 });
        let error = learner.imitate(&steps, 0, &ImitationConfig::default()).expect_err("unknown").to_string();
        assert!(error.contains("do not say where") && error.contains("`ppo.memory`"), "{error}");
    }
}
