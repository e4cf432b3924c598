//! Policies out of ONNX graphs that other trainers wrote.
//!
//! The folder, in reading order:
//!
//! - `trace`: the chain of layers in a graph.
//! - `heads`: the outputs that describe an action.
//! - `native`: the layers of a policy in that chain.

mod heads;
mod native;
mod trace;

use crate::{
    error::OnnxError,
    evaluator::{Elem, Evaluator, Port, Value},
    export::FORM,
    import::{
        heads::{Heads, Spread},
        native::{Native, SMALL_LOG_STD},
        trace::Trace,
    },
    policy_form::{PolicyForm, Stored},
};
use playbot_learner::{
    ActionSpace, DeviceKind, FileError, ImageShape, ObsKind, ObsSlice, Observations, PolicyFile, PolicyMetadata,
    rng::{Streams, normal},
};
use std::{collections::BTreeMap, fmt, path::Path};

/// Largest difference between a graph and its translation, relative to numbers above 1.
const TOLERANCE: f64 = 1e-4;

/// Random observations of the comparison.
const VECTORS: usize = 48;
const IMAGES: usize = 12;

/// Ticks of an episode in the comparison, for graphs with a state.
const TICKS: usize = 6;

/// Observations by which the policy checks itself when it is made.
const EXAMPLES: usize = 2;

/// Most nodes of a graph.
const MOST_NODES: usize = 10_000;

/// What a policy must fit: a game's observations and actions.
///
/// ```
/// use playbot_learner::{ActionSpace, ObsKind, PolicyMetadata};
/// use playbot_onnx::ImportTarget;
///
/// let metadata = PolicyMetadata { game: "pong".to_owned(), game_version: 1, ..PolicyMetadata::default() };
/// let target = ImportTarget { observation: ObsKind::Vector(6), action_space: ActionSpace::Discrete(3), metadata };
/// let error = target.import("bot.onnx".as_ref(), b"no graph").expect_err("no ONNX file");
/// assert!(error.to_string().contains("no ONNX file, or it is cut off"), "{error}");
/// ```
#[derive(Clone, Debug)]
pub struct ImportTarget {
    /// The kind of observations.
    pub observation: ObsKind,
    /// The actions.
    pub action_space: ActionSpace,
    /// Game, version of its rules, and names of observations and actions. Algorithm and training are filled in from the
    /// file, if it names them.
    pub metadata: PolicyMetadata,
}

/// A policy out of a graph, and the graph.
#[derive(Debug)]
pub struct ImportedPolicy {
    /// The policy.
    pub file: PolicyFile,
    /// What was taken and what was assumed, in sentences.
    pub notes: Vec<String>,
    /// Largest difference to the graph over random observations, relative to numbers above 1.
    pub difference: f64,
    source: Source,
}

/// A graph, with its inputs and the values that describe actions.
struct Source {
    graph: Evaluator,
    heads: Heads,
    inputs: Inputs,
}

/// The inputs of a graph, with the sizes for one observation.
#[derive(Clone, Debug)]
struct Inputs {
    observation: (String, Elem, Vec<usize>),
    /// State before a tick: name and sizes, and the value that is the state after it.
    state: Option<(String, Vec<usize>, String)>,
}

impl ImportTarget {
    /// Translates an ONNX file in memory and compares both over random observations; `name` is for messages.
    ///
    /// Supported is one chain from the observation to the actions: normalisation, convolutions of the Nature or Impala
    /// network, one recurrent layer, dense layers with Relu or Tanh, and logits or means. Other outputs are ignored.
    ///
    /// # Errors
    /// [`OnnxError::Unsupported`] names the node that no policy has; [`OnnxError::Misfit`] says which sizes or names are
    /// not the game's; [`OnnxError::Foreign`] describes an unsound file; [`OnnxError::Differs`] if the comparison fails.
    pub fn import(&self, name: &Path, bytes: &[u8]) -> Result<ImportedPolicy, OnnxError> {
        let graph = Evaluator::parse(name, bytes)?;
        self.check_metadata(&graph)?;
        if graph.nodes.len() > MOST_NODES {
            return Err(OnnxError::Misfit(format!("the graph has {} nodes, more than any policy", graph.nodes.len())));
        }
        let mut inputs = self.inputs(&graph)?;
        let first = self.random(1);
        let trace = Trace::of(&graph, inputs.values(first.as_slice(), None));
        let heads = Heads::of(&graph, &trace, self.action_space)?;
        let native = Native::of(&heads, self.observation)?;
        match (&mut inputs.state, &native.state) {
            (Some(state), Some((input, after))) if state.0 == *input => after.clone_into(&mut state.2),
            (None, None) => {}
            (Some((input, ..)), _) => {
                let text =
                    format!("the actions do not depend on the input `{input}`, which is no state of a GRU layer");
                return Err(OnnxError::Misfit(text));
            }
            (None, Some(_)) => return Err(OnnxError::Misfit("the state of the GRU layer is no input".to_owned())),
        }
        let notes = self.notes(&heads);
        let mut form = native.into_form(self.action_space, self.observation, self.metadata(name, &graph));
        let source = Source { graph, heads, inputs };
        let file = source.policy_file(name, &mut form, &self.random(EXAMPLES))?;
        let mut policy = ImportedPolicy { file, notes, difference: 0.0, source };
        let count = if matches!(self.observation, ObsKind::Image(_)) { IMAGES } else { VECTORS };
        policy.difference = policy.compare(&self.random(count), count)?;
        Ok(policy)
    }

    /// Checks game, version and names of a file that this program exported.
    fn check_metadata(&self, graph: &Evaluator) -> Result<(), OnnxError> {
        if graph.metadata(FORM).is_none() {
            return Ok(());
        }
        let misfit = |text: String| Err(OnnxError::Misfit(text));
        let own = &self.metadata;
        if let Some(game) = graph.metadata("game").filter(|game| *game != own.game) {
            return misfit(format!("the policy was exported for the game `{game}`, not for `{}`", own.game));
        }
        let version = own.game_version.to_string();
        if let Some(of) = graph.metadata("game_version").filter(|of| *of != version) {
            return misfit(format!(
                "the policy was exported for version {of} of the rules of `{}`, not for {version}",
                own.game
            ));
        }
        for (key, ours) in [("observations", &own.observations), ("actions", &own.actions)] {
            let names = graph.metadata(key).and_then(|text| serde_json::from_str::<Vec<String>>(text).ok());
            let names = names.filter(|names| !names.is_empty() && !ours.is_empty()).unwrap_or_else(|| ours.clone());
            let name_at = |names: &[String], at: usize| names.get(at).cloned().unwrap_or_else(|| "nothing".to_owned());
            if let Some(at) = (0..names.len().max(ours.len())).find(|&at| names.get(at) != ours.get(at)) {
                let (found, expected) = (name_at(&names, at), name_at(ours, at));
                return misfit(format!(
                    "number {at} of the {key} is `{found}` in the file and `{expected}` in the game"
                ));
            }
        }
        Ok(())
    }

    /// Finds observation and state among the inputs of a graph.
    fn inputs(&self, graph: &Evaluator) -> Result<Inputs, OnnxError> {
        let misfit = |text: String| Err(OnnxError::Misfit(text));
        let names: Vec<String> = graph.inputs().map(|name| format!("`{name}`")).collect();
        if graph.inputs.iter().any(|port| port.name == "skill") {
            return misfit(
                "the graph reads the input `skill`: a policy over skills needs its decoder, which no ONNX file holds, so it \
                 cannot be imported; ship the policy file instead"
                    .to_owned(),
            );
        }
        let (observation, state) = match &graph.inputs[..] {
            [one] => (one, None),
            [a, b] => {
                let count = |port: &Port| self.sizes(port, self.observation.numbers()).is_ok();
                let is_state = |port: &Port| {
                    let name = port.name.to_lowercase();
                    ["state", "memory", "hidden"].iter().any(|word| name.contains(word)) || name.starts_with('h')
                };
                if is_state(a) && !is_state(b) || !is_state(b) && !count(a) && count(b) {
                    (b, Some(a))
                } else {
                    (a, Some(b))
                }
            }
            _ => {
                return misfit(format!(
                    "the graph has the inputs {}: a policy reads an observation, and at most one state beside it",
                    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
                ));
            }
        };
        let elem = observation.elem.unwrap_or(Elem::Single);
        let sizes = self.sizes(observation, self.observation.numbers())?;
        let state = match state {
            None => None,
            Some(port) => {
                let sizes: Option<Vec<usize>> =
                    port.sizes.as_ref().map(|sizes| sizes.iter().map(|size| size.unwrap_or(1)).collect());
                let sizes = sizes.filter(|sizes| sizes.iter().product::<usize>() < 1 << 20);
                let text = format!("the input `{}` must have fixed sizes except for the batch", port.name);
                Some((port.name.clone(), sizes.ok_or(OnnxError::Misfit(text))?, String::new()))
            }
        };
        Ok(Inputs { observation: (observation.name.clone(), elem, sizes), state })
    }

    /// Returns the sizes of an input for one observation of `numbers` numbers.
    fn sizes(&self, port: &Port, numbers: usize) -> Result<Vec<usize>, OnnxError> {
        let name = &port.name;
        let image = match self.observation {
            ObsKind::Image(ImageShape { channels, height, width }) => Some([channels, height, width]),
            ObsKind::Vector(_) => None,
        };
        let Some(sizes) = &port.sizes else {
            return Ok(match image {
                Some([channels, height, width]) => vec![1, channels, height, width],
                None => vec![1, numbers],
            });
        };
        let mut fixed: Vec<usize> = sizes.iter().map(|size| size.unwrap_or(1)).collect();
        // Behind a batch a single free size can only be that of the observation.
        let free: Vec<usize> = (0..sizes.len()).filter(|&axis| sizes[axis].is_none()).collect();
        let found = fixed.iter().fold(1_usize, |all, &size| all.saturating_mul(size));
        let last = free.last().filter(|last| **last > 0 && found > 0 && numbers.is_multiple_of(found));
        if let Some(last) = last {
            fixed[*last] = numbers / found;
        }
        let found = fixed.iter().fold(1_usize, |all, &size| all.saturating_mul(size));
        if found != numbers {
            let batch = fixed.first().copied().unwrap_or(1);
            if batch > 1 && found == batch * numbers {
                return Err(OnnxError::Misfit(format!(
                    "the input `{name}` has a batch of {batch}: export the graph with a free batch, or with one of 1"
                )));
            }
            return Err(OnnxError::Misfit(format!(
                "the input `{name}` has {found} numbers, and the game observes {}: they must be the same",
                self.observation.describe()
            )));
        }
        match image {
            Some(image) if fixed.len() >= 4 && fixed[fixed.len() - 3..] != image => Err(OnnxError::Misfit(format!(
                "the input `{name}` has the sizes {fixed:?}: pixels lie in the order channel, row, column, {image:?}"
            ))),
            _ => Ok(fixed),
        }
    }

    /// Returns random observations.
    fn random(&self, n: usize) -> Observations {
        let mut rng = Streams::new(7).stream("onnx.import", 0);
        match self.observation {
            ObsKind::Vector(width) => {
                let number = |i: usize| if (i / width.max(1)).is_multiple_of(3) { 4.0 } else { 1.0 };
                let values: Vec<f32> = (0..n * width).map(|i| number(i) * normal(&mut rng)).collect();
                values.into()
            }
            ObsKind::Image(image) => {
                let mut area = 0.0;
                let byte = |i: usize| {
                    if i.is_multiple_of(37) {
                        area = 128.0 + 90.0 * normal(&mut rng);
                    }
                    (area + 20.0 * normal(&mut rng)).clamp(0.0, 255.0) as u8
                };
                Observations::Image((0..n * image.numbers()).map(byte).collect())
            }
        }
    }

    /// Returns the metadata of the policy, with what the file says of itself.
    fn metadata(&self, name: &Path, graph: &Evaluator) -> PolicyMetadata {
        let is_own = graph.metadata(FORM).is_some();
        let own = |key: &str| graph.metadata(key).filter(|_| is_own);
        let file = name.file_name().unwrap_or_default().to_string_lossy();
        let by = match graph.producer() {
            "" => String::new(),
            producer => format!(", written by {producer}"),
        };
        let training = own("training").map(|training| format!("{training}, imported from {file}"));
        PolicyMetadata {
            algorithm: own("algorithm").unwrap_or("onnx").to_owned(),
            training: training.unwrap_or_else(|| format!("imported from {file}{by}")),
            seen: own("seen").and_then(|text| serde_json::from_str(text).ok()),
            ..self.metadata.clone()
        }
    }

    fn notes(&self, heads: &Heads) -> Vec<String> {
        let taken: Vec<String> = heads.taken.iter().map(|name| format!("`{name}`")).collect();
        let mut notes = vec![format!("actions come from the output {}", taken.join(" and "))];
        if let (Spread::None, true) = (&heads.spread, heads.numbers > 0) {
            notes.push(format!(
                "the graph has no output `log_std`: ln σ = {SMALL_LOG_STD} is assumed, so that drawn actions are near the mean"
            ));
        }
        notes
    }
}

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Source").field("taken", &self.heads.taken).finish_non_exhaustive()
    }
}

impl Source {
    /// Returns the policy of these arrays, which checks itself by what the graph gives for some observations.
    fn policy_file(&self, name: &Path, form: &mut PolicyForm, obs: &Observations) -> Result<PolicyFile, OnnxError> {
        let shape = &form.description.policy;
        let (observed, space) = (shape.observation(), shape.action_space);
        let (n, width) = (EXAMPLES, observed.numbers());
        let (mut head, mut spread) = (Vec::new(), Vec::new());
        for row in 0..n {
            let (of_row, log_std, _) = self.distribution(obs.row(row, width), None)?;
            let log_std = log_std.unwrap_or_else(|| vec![SMALL_LOG_STD; space.numbers()]);
            head.extend(of_row.iter().map(|&x| x as f32));
            spread.extend(log_std.iter().map(|&x| x as f32));
        }
        match obs {
            Observations::Vector(values) => form.put("examples.obs", &[n, width], values.clone()),
            Observations::Image(bytes) => {
                let bytes = Stored::Bytes(vec![n, width], bytes.clone());
                form.arrays.insert("examples.obs".to_owned(), bytes);
            }
        }
        form.put("examples.z", &[n, 0], Vec::new());
        form.put("examples.head", &[n, space.dim()], head);
        form.put("examples.log_std", &[n, space.numbers()], spread);
        form.put("examples.value", &[n, 1], vec![0.0; n]);
        form.description.examples = n;
        PolicyFile::from_bytes(name, &form.to_bytes(name)?, DeviceKind::default()).map_err(|error| match error {
            FileError::Example { example, what, expected, found, .. } => OnnxError::Differs {
                row: example,
                output: what.to_owned(),
                at: 0,
                expected: f64::from(expected),
                found: f64::from(found),
            },
            error => error.into(),
        })
    }

    /// Returns logarithms of probabilities and means, ln σ if known, and the state after one observation.
    fn distribution(
        &self,
        obs: ObsSlice<'_>,
        state: Option<&Value>,
    ) -> Result<(Vec<f64>, Option<Vec<f64>>, Option<Value>), OnnxError> {
        let after = self.inputs.state.as_ref().map(|(_, _, after)| after.as_str());
        let wanted: Vec<&str> = self.heads.values().into_iter().chain(after).collect();
        let mut values = self.graph.run(self.inputs.values(obs, state), &wanted)?;
        let (head, spread) = self.heads.distribution(&values);
        Ok((head, spread, after.and_then(|after| values.remove(after))))
    }
}

impl Inputs {
    /// Returns the values of the inputs for one observation, and for the state before it or zeros.
    fn values(&self, obs: ObsSlice<'_>, state: Option<&Value>) -> BTreeMap<String, Value> {
        let (name, elem, shape) = &self.observation;
        let numbers: Vec<f64> = match obs {
            ObsSlice::Vector(values) => values.iter().map(|&x| f64::from(x)).collect(),
            ObsSlice::Image(bytes) => bytes.iter().map(|&x| f64::from(x)).collect(),
        };
        let observation = Value { elem: *elem, shape: shape.clone(), numbers };
        let mut values = BTreeMap::from([(name.clone(), observation)]);
        if let Some((name, shape, _)) = &self.state {
            let zeros = || vec![0.0; shape.iter().product()];
            let numbers = state.map_or_else(zeros, |state| state.numbers.clone());
            values.insert(name.clone(), Value { elem: Elem::Single, shape: shape.clone(), numbers });
        }
        values
    }
}

impl ImportedPolicy {
    /// Compares graph and policy over `n` observations, such as some of the game, in episodes of a few ticks. Returns the
    /// largest difference, relative to numbers above 1.
    ///
    /// # Errors
    /// [`OnnxError::Differs`] if a number differs by more than 1e-4; [`OnnxError::Misfit`] or [`OnnxError::Learn`] if
    /// the observations are not the policy's.
    pub fn compare<'a>(&self, obs: impl Into<ObsSlice<'a>>, n: usize) -> Result<f64, OnnxError> {
        let (policy, obs) = (&self.file.policy, obs.into());
        let width = policy.obs_dim();
        let found = obs.numbers();
        if found != n * width {
            return Err(OnnxError::Misfit(format!(
                "{n} observations of the policy have {} numbers, not {found}",
                n * width
            )));
        }
        let (mut state, mut memory) = (None, Vec::new());
        let mut largest: f64 = 0.0;
        for row in 0..n {
            if row.is_multiple_of(TICKS) {
                (state, memory) = (None, Vec::new());
            }
            let one = obs.rows(row..row + 1, width);
            let (head, spread, after) = self.source.distribution(one, state.as_ref())?;
            let output = policy.forward_remembering(&[], &[], &memory, one, 1)?;
            let none = Vec::new();
            for (name, expected, found) in [
                ("the distribution", &head, &output.head),
                ("log_std", spread.as_ref().unwrap_or(&none), &output.log_std),
            ] {
                for (at, (&expected, &found)) in expected.iter().zip(found).enumerate() {
                    let difference = (expected - f64::from(found)).abs() / expected.abs().max(1.0);
                    // Not a number is no small difference either.
                    if difference.is_nan() || difference > TOLERANCE {
                        let (output, found) = (name.to_owned(), f64::from(found));
                        return Err(OnnxError::Differs { row, output, at, expected, found });
                    }
                    largest = largest.max(difference);
                }
            }
            (state, memory) = (after, output.memory);
        }
        Ok(largest)
    }
}
