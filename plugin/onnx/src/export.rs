//! Policies and priors as ONNX graphs.

use crate::{
    error::OnnxError,
    graph::{Attribute, Graph},
    messages::{ValueInfoProto, data_type},
    policy_form::{ActorShape, EntityShape, MemoryShape, PolicyForm, StdShape},
};
use playbot_learner::{DeviceKind, EntityBlock, ObsKind, PolicyFile, nn::CnnKind, policy::NetShape, write_atomically};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Version of names, shapes and metadata of exported graphs.
pub(crate) const FORM_VERSION: u32 = 1;

/// Key of that version among the metadata.
pub(crate) const FORM: &str = "playbot_form";

/// Bound of normalised observations.
pub(crate) const CLIP: f64 = 10.0;

/// Bounds of ln σ from a head of its own.
pub(crate) const LOG_STD_RANGE: (f32, f32) = (-10.0, 2.0);

/// Strides of the convolutions of the Nature network.
pub(crate) const NATURE_STRIDES: [usize; 3] = [4, 2, 1];

/// The ONNX files of a policy: its graph and, if it reads skills, that of their prior.
///
/// Names, shapes and metadata are in `docs/reference/policy-files.md`. Equal policies have equal bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OnnxPolicy {
    /// The graph `policy`: observation, skill and memory in; action, distribution, value and memory out.
    pub policy: Vec<u8>,
    /// The graph `prior`: observation, memory and noise in; skill and memory out. `None` for policies without skills.
    pub prior: Option<Vec<u8>>,
}

impl OnnxPolicy {
    /// Translates a policy file in memory, which is checked first; `name` is for messages.
    ///
    /// # Errors
    /// [`OnnxError::File`] if the policy file is unsound, [`OnnxError::Form`] if it is of another version.
    pub fn of_policy_file(name: &Path, bytes: &[u8]) -> Result<Self, OnnxError> {
        PolicyFile::from_bytes(name, bytes, DeviceKind::default())?;
        Self::of_form(&PolicyForm::parse(name, bytes)?)
    }

    /// Translates the contents of a policy file.
    pub(crate) fn of_form(form: &PolicyForm) -> Result<Self, OnnxError> {
        let reads_skills = form.description.policy.actor.net.latent > 0;
        let prior = if reads_skills { Some(prior_graph(form)?) } else { None };
        Ok(Self { policy: policy_graph(form)?, prior })
    }

    /// Returns the path of the prior beside the path of its policy: `NAME.prior.onnx` beside `NAME.onnx`.
    ///
    /// ```
    /// use playbot_onnx::OnnxPolicy;
    /// use std::path::Path;
    ///
    /// assert_eq!(OnnxPolicy::prior_path(Path::new("a/bot.onnx")), Path::new("a/bot.prior.onnx"));
    /// ```
    pub fn prior_path(path: &Path) -> PathBuf {
        path.with_extension("prior.onnx")
    }

    /// Writes both files, the prior first, and returns the path of the prior.
    ///
    /// # Errors
    /// [`OnnxError::Write`].
    pub fn save(&self, path: &Path) -> Result<Option<PathBuf>, OnnxError> {
        let write = |path: &Path, bytes: &[u8]| {
            write_atomically(path, bytes).map_err(|source| OnnxError::Write { path: path.to_owned(), source })
        };
        let prior = self.prior.as_ref().map(|prior| {
            let path = Self::prior_path(path);
            write(&path, prior).map(|()| path)
        });
        let prior = prior.transpose()?;
        write(path, &self.policy)?;
        Ok(prior)
    }
}

// The two graphs.

const OBSERVATION: &str = "raw values, as the game gives them: the graph normalises them itself";
const PIXELS: &str = "pixels from 0 to 255, in the order channel, row, column: the graph divides them by 255 itself";
const MEMORY: &str = "the output `memory_after` of the tick before; zeros at the beginning of an episode";
const AFTER: &str = "the input `memory` of the next tick";

/// The outputs of a graph, with their sizes for the metadata.
struct Ports {
    inputs: Vec<Value>,
    outputs: Vec<Value>,
}

impl Ports {
    fn port(name: &str, elem_type: i32, sizes: &[usize]) -> Value {
        let kind = match elem_type {
            data_type::UINT8 => "uint8",
            data_type::INT64 => "int64",
            _ => "float32",
        };
        let sizes = std::iter::once(json!("batch")).chain(sizes.iter().map(|size| json!(size)));
        json!({ "name": name, "type": kind, "shape": sizes.collect::<Vec<_>>() })
    }

    fn input(&mut self, graph: &mut Graph, name: &str, elem_type: i32, sizes: &[usize], doc: &str) -> String {
        self.inputs.push(Self::port(name, elem_type, sizes));
        graph.input(ValueInfoProto::batched(name, elem_type, sizes, doc))
    }

    fn output(&mut self, graph: &mut Graph, value: &str, name: &str, elem_type: i32, sizes: &[usize], doc: &str) {
        self.outputs.push(Self::port(name, elem_type, sizes));
        graph.output(ValueInfoProto::batched(name, elem_type, sizes, doc), value);
    }
}

fn policy_graph(form: &PolicyForm) -> Result<Vec<u8>, OnnxError> {
    let shape = &form.description.policy;
    let (space, latent) = (shape.action_space, shape.actor.net.latent);
    let mut graph = Graph::new("policy");
    let mut ports = Ports { inputs: Vec::new(), outputs: Vec::new() };
    let stats = shape.normalised.then_some("obs_norm");
    let net = Net { form, prefix: "actor", shape: &shape.actor, stats };
    let observation = net.observation_input(&mut graph, &mut ports, shape.observation());
    let skill = (latent > 0).then(|| {
        let doc = "the present skill, an output of the prior's graph, which is used for several ticks";
        ports.input(&mut graph, "skill", data_type::FLOAT, &[latent], doc)
    });
    let (x, after) = net.inputs(&mut graph, &mut ports, &observation, shape.observation(), skill.as_deref())?;
    let features = net.hidden(&mut graph, "actor", &shape.actor.net, &x)?;
    let head = net.linear(&mut graph, "actor.head", &features)?;
    let (options, numbers) = (space.options(), space.numbers());
    let is_one = matches!(space, playbot_learner::ActionSpace::Discrete(_));
    let mut choices = None;
    if options > 0 {
        let (mut log_probs, mut taken) = (Vec::new(), Vec::new());
        let ranges: Vec<_> = space.choices().ranges().collect();
        for range in &ranges {
            let is_all = range.len() == space.dim();
            let logits = if is_all { head.clone() } else { graph.slice(&head, 1, range.start, range.end) };
            let log_prob = graph.node("LogSoftmax", &[&logits], &[Attribute::Int("axis", 1)]);
            let keep = Attribute::Int("keepdims", i64::from(!is_one));
            taken.push(graph.node("ArgMax", &[&log_prob], &[Attribute::Int("axis", 1), keep]));
            log_probs.push(log_prob);
        }
        choices = Some((graph.concat(&taken, 1), graph.concat(&log_probs, 1), ranges.len()));
    }
    let of_choices = |graph: &mut Graph, ports: &mut Ports, name: &str| {
        if let Some((taken, log_probs, count)) = &choices {
            let (sizes, doc) = match is_one {
                true => (vec![], "the most likely action, the first of equals"),
                false => (vec![*count], "the most likely option of each choice, the first of equals"),
            };
            ports.output(graph, taken, name, data_type::INT64, &sizes, doc);
            let doc = "normalised logarithms of the probabilities of all options, choice by choice";
            ports.output(graph, log_probs, "log_probabilities", data_type::FLOAT, &[options], doc);
        }
    };
    if numbers == 0 {
        of_choices(&mut graph, &mut ports, "action");
    } else {
        if options > 0 {
            of_choices(&mut graph, &mut ports, "choices");
        }
        let mean = if options > 0 { graph.slice(&head, 1, options, options + numbers) } else { head.clone() };
        let log_std = net.log_std(&mut graph, "actor.log_std", &features, &mean, numbers)?;
        let is_squashed = matches!(shape.actor.std, StdShape::Squashed(..));
        let (action, doc) = match is_squashed {
            true => (graph.node("Tanh", &[&mean], &[]), "the most likely action: the tanh of the mean"),
            false => (mean.clone(), "the most likely numbers: their mean"),
        };
        let name = if options > 0 { "numbers" } else { "action" };
        ports.output(&mut graph, &action, name, data_type::FLOAT, &[numbers], doc);
        let doc = match is_squashed {
            true => "mean of the normal number whose tanh is the action",
            false => "mean of the numbers",
        };
        ports.output(&mut graph, &mean, "mean", data_type::FLOAT, &[numbers], doc);
        let doc = "logarithm of the standard deviation of each number";
        ports.output(&mut graph, &log_std, "log_std", data_type::FLOAT, &[numbers], doc);
    }
    if let Some(critic) = &shape.critic {
        let features = net.hidden(&mut graph, "critic", critic, &x)?;
        let mut value = net.linear(&mut graph, "critic.head", &features)?;
        if form.arrays.contains_key("critic.clock.weight") {
            // As the program values a skill that was just drawn: all of its ticks remain.
            let clock = net.linear(&mut graph, "critic.clock", &features)?;
            value = graph.node("Add", &[&value, &clock], &[]);
        }
        let value = graph.reaxis("Squeeze", &value, 1);
        let doc = "estimated return, in the unit of the training's scaled rewards";
        ports.output(&mut graph, &value, "value", data_type::FLOAT, &[], doc);
    }
    if let Some((after, width)) = after {
        ports.output(&mut graph, &after, "memory_after", data_type::FLOAT, &[width], AFTER);
    }
    let metadata = metadata(form, &ports);
    Ok(graph.into_bytes(about(form, "The policy"), metadata))
}

fn prior_graph(form: &PolicyForm) -> Result<Vec<u8>, OnnxError> {
    let description = &form.description;
    let observed = description.policy.observation();
    let skills = description.skills.as_ref();
    let skills = skills.ok_or_else(|| OnnxError::Form("the policy reads skills, and the file has none".to_owned()))?;
    let latent = skills.latent;
    let mut graph = Graph::new("prior");
    let mut ports = Ports { inputs: Vec::new(), outputs: Vec::new() };
    let noise_doc = "standard normal numbers for a random skill, zeros for the most likely one";
    let (mut skill, mut after) = (String::new(), None);
    match &skills.prior {
        None => {
            let shape = &description.policy.actor;
            let net = Net { form, prefix: "prior", shape, stats: None };
            net.observation_input(&mut graph, &mut ports, observed);
            skill.push_str(&ports.input(&mut graph, "noise", data_type::FLOAT, &[latent], noise_doc));
        }
        Some(shape) => {
            let stats = skills.normalised.then_some("skill.obs_norm");
            let net = Net { form, prefix: "prior", shape, stats };
            let observation = net.observation_input(&mut graph, &mut ports, observed);
            let x;
            (x, after) = net.inputs(&mut graph, &mut ports, &observation, observed, None)?;
            let noise = ports.input(&mut graph, "noise", data_type::FLOAT, &[latent], noise_doc);
            let features = net.hidden(&mut graph, "prior", &shape.net, &x)?;
            let mean = net.linear(&mut graph, "prior.head", &features)?;
            let log_std = net.log_std(&mut graph, "prior.log_std", &features, &mean, latent)?;
            let std = graph.node("Exp", &[&log_std], &[]);
            let spread = graph.node("Mul", &[&noise, &std], &[]);
            skill = graph.node("Add", &[&mean, &spread], &[]);
        }
    }
    if skills.tanh {
        skill = graph.node("Tanh", &[&skill], &[]);
    }
    let doc = "the input `skill` of the policy's graph for the next ticks";
    ports.output(&mut graph, &skill, "skill", data_type::FLOAT, &[latent], doc);
    if let Some((after, width)) = after {
        ports.output(
            &mut graph,
            &after,
            "memory_after",
            data_type::FLOAT,
            &[width],
            "the input `memory` of the next draw",
        );
    }
    let metadata = metadata(form, &ports);
    Ok(graph.into_bytes(about(form, "The prior over skills of the policy"), metadata))
}

fn about(form: &PolicyForm, what: &str) -> String {
    let of = &form.description.metadata;
    format!("{what} `{}` for the game `{}`, version {} of its rules", of.algorithm, of.game, of.game_version)
}

/// Returns the metadata of a graph, in the order in which they are written.
fn metadata(form: &PolicyForm, ports: &Ports) -> Vec<(String, String)> {
    let (of, skills) = (&form.description.metadata, &form.description.skills);
    let mut entries = vec![
        (FORM, FORM_VERSION.to_string()),
        ("game", of.game.clone()),
        ("game_version", of.game_version.to_string()),
        ("observations", json!(of.observations).to_string()),
        ("actions", json!(of.actions).to_string()),
        ("action_space", json!(form.description.policy.action_space).to_string()),
        ("algorithm", of.algorithm.clone()),
        ("training", of.training.clone()),
        ("code", of.code.clone()),
        ("inputs", json!(ports.inputs).to_string()),
        ("outputs", json!(ports.outputs).to_string()),
    ];
    if let Some(picture) = &of.picture {
        entries.push(("picture", json!(picture).to_string()));
    }
    if let Some(seen) = &of.seen {
        entries.push(("seen", json!(seen).to_string()));
    }
    if let Some(skills) = skills {
        let draw = match skills.draw {
            playbot_learner::SkillDraw::Sample => "sample",
            playbot_learner::SkillDraw::Mean => "mean",
        };
        entries.push(("skill_interval", skills.skill_interval.to_string()));
        entries.push(("skill_draw", draw.to_owned()));
    }
    entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

// The layers of an actor, a critic or a prior.

/// The networks of a policy file whose arrays begin with `prefix`.
struct Net<'a> {
    form: &'a PolicyForm,
    prefix: &'a str,
    shape: &'a ActorShape,
    /// Name of the normaliser, if observations are normalised.
    stats: Option<&'a str>,
}

impl Net<'_> {
    fn name(&self, rest: &str) -> String {
        format!("{}.{rest}", self.prefix)
    }

    fn observation_input(&self, graph: &mut Graph, ports: &mut Ports, observed: ObsKind) -> String {
        match observed {
            ObsKind::Vector(width) => ports.input(graph, "observation", data_type::FLOAT, &[width], OBSERVATION),
            ObsKind::Image(image) => {
                let sizes = [image.channels, image.height, image.width];
                ports.input(graph, "observation", data_type::UINT8, &sizes, PIXELS)
            }
        }
    }

    /// Returns what the layers read: skill, observation or its features, memory. With the state after this tick and its
    /// width, if there is a memory.
    fn inputs(
        &self,
        graph: &mut Graph,
        ports: &mut Ports,
        observation: &str,
        observed: ObsKind,
        skill: Option<&str>,
    ) -> Result<(String, Option<(String, usize)>), OnnxError> {
        let seen = match (observed, &self.shape.cnn) {
            (ObsKind::Image(_), Some(cnn)) => self.trunk(graph, cnn, observation)?,
            _ => self.normalised(graph, observation)?,
        };
        let lead: Vec<String> = skill.map(str::to_owned).into_iter().collect();
        let x = match &self.shape.entities {
            None => graph.concat(&[lead, vec![seen]].concat(), 1),
            Some(entities) => self.encoded(graph, entities, lead, &seen)?,
        };
        let (Some(memory), width) = (self.shape.memory, self.shape.remembers()) else { return Ok((x, None)) };
        let before = ports.input(graph, "memory", data_type::FLOAT, &[width], MEMORY);
        match memory {
            MemoryShape::Gru { hidden } => {
                let after = self.gru(graph, &x, &before, hidden)?;
                let x = graph.concat(&[x, after.clone()], 1);
                Ok((x, Some((after, width))))
            }
            MemoryShape::Stack { .. } => {
                let (lead, seen) = (self.shape.net.latent, self.shape.seen());
                let newest = if lead > 0 { graph.slice(&x, 1, lead, lead + seen) } else { x.clone() };
                let both = graph.concat(&[newest, before.clone()], 1);
                let after = graph.slice(&both, 1, 0, width);
                Ok((graph.concat(&[x, before], 1), Some((after, width))))
            }
        }
    }

    /// Normalises in double precision, as the program does.
    fn normalised(&self, graph: &mut Graph, observation: &str) -> Result<String, OnnxError> {
        let Some(stats) = self.stats else { return Ok(observation.to_owned()) };
        let vector = |graph: &mut Graph, part: &str| -> Result<String, OnnxError> {
            let name = format!("{stats}.{part}");
            let numbers = self.form.double(&name)?;
            Ok(graph.doubles(&name, &[numbers.len()], numbers))
        };
        let (mean, scale) = (vector(graph, "mean")?, vector(graph, "inv_std")?);
        let (low, high) = (graph.doubles("clip.low", &[], &[-CLIP]), graph.doubles("clip.high", &[], &[CLIP]));
        let x = graph.cast(observation, data_type::DOUBLE);
        let x = graph.node("Sub", &[&x, &mean], &[]);
        let x = graph.node("Mul", &[&x, &scale], &[]);
        let x = graph.node("Clip", &[&x, &low, &high], &[]);
        Ok(graph.cast(&x, data_type::FLOAT))
    }

    fn array(&self, graph: &mut Graph, name: &str) -> Result<String, OnnxError> {
        let (shape, numbers) = self.form.single(name)?;
        Ok(graph.floats(name, shape, numbers))
    }

    /// Applies a dense layer to rows.
    fn linear(&self, graph: &mut Graph, name: &str, x: &str) -> Result<String, OnnxError> {
        let weight = self.array(graph, &format!("{name}.weight"))?;
        let bias = self.array(graph, &format!("{name}.bias"))?;
        Ok(graph.node("Gemm", &[x, &weight, &bias], &[]))
    }

    /// Applies the hidden layers of a network.
    fn hidden(&self, graph: &mut Graph, prefix: &str, net: &NetShape, x: &str) -> Result<String, OnnxError> {
        let activation = format!("{:?}", net.activation);
        let mut x = x.to_owned();
        for layer in 0..net.hidden.len() {
            let y = self.linear(graph, &format!("{prefix}.l{layer}"), &x)?;
            x = graph.node(&activation, &[&y], &[]);
        }
        Ok(x)
    }

    /// Returns ln σ of each number, `[batch, numbers]`.
    fn log_std(
        &self,
        graph: &mut Graph,
        name: &str,
        features: &str,
        mean: &str,
        numbers: usize,
    ) -> Result<String, OnnxError> {
        Ok(match self.shape.std {
            StdShape::Vector => {
                let (_, values) = self.form.single(name)?;
                let vector = graph.floats(name, &[1, numbers], values);
                let shape = graph.node("Shape", &[mean], &[]);
                graph.node("Expand", &[&vector, &shape], &[])
            }
            StdShape::State => {
                let raw = self.linear(graph, name, features)?;
                let (low, high) = LOG_STD_RANGE;
                let (low, high) =
                    (graph.floats("log_std.low", &[], &[low]), graph.floats("log_std.high", &[], &[high]));
                graph.node("Clip", &[&raw, &low, &high], &[])
            }
            StdShape::Squashed(low, high) => {
                let raw = self.linear(graph, name, features)?;
                let bounded = graph.node("Tanh", &[&raw], &[]);
                let one = graph.floats("one", &[], &[1.0]);
                let scale = graph.floats("log_std.scale", &[], &[(0.5 * (high - low)) as f32]);
                let low = graph.floats("log_std.low", &[], &[low as f32]);
                let above = graph.node("Add", &[&bounded, &one], &[]);
                let scaled = graph.node("Mul", &[&above, &scale], &[]);
                graph.node("Add", &[&scaled, &low], &[])
            }
        })
    }

    /// Puts the values beside sets in front, and then the pooled features of each set.
    fn encoded(&self, graph: &mut Graph, shape: &EntityShape, lead: Vec<String>, x: &str) -> Result<String, OnnxError> {
        let (mut parts, mut from) = (lead, 0);
        for block in &shape.blocks {
            let range = block.range();
            if from < range.start {
                parts.push(graph.slice(x, 1, from, range.start));
            }
            from = range.end;
        }
        if from < shape.obs_dim {
            parts.push(graph.slice(x, 1, from, shape.obs_dim));
        }
        for (number, block) in shape.blocks.iter().enumerate() {
            self.pooled(graph, x, number, *block, &mut parts)?;
        }
        Ok(graph.concat(&parts, 1))
    }

    /// Adds mean and maximum over the things of a set, and the logarithm of one more than their number.
    fn pooled(
        &self,
        graph: &mut Graph,
        x: &str,
        number: usize,
        block: EntityBlock,
        parts: &mut Vec<String>,
    ) -> Result<(), OnnxError> {
        let slot = block.width + 1;
        let flat = graph.slice(x, 1, block.start, block.range().end);
        // 0 keeps the batch.
        let sizes = graph.whole(&[0, block.slots as i64, slot as i64]);
        let set = graph.node("Reshape", &[&flat, &sizes], &[]);
        let presence = graph.slice(&set, 2, 0, 1);
        let (half, one) = (graph.floats("half", &[], &[0.5]), graph.floats("one", &[], &[1.0]));
        let present = graph.node("Greater", &[&presence, &half], &[]);
        let present = graph.cast(&present, data_type::FLOAT);
        let mut features = graph.slice(&set, 2, 1, slot);
        for layer in ["l0", "l1"] {
            let name = self.name(&format!("entities.s{number}.{layer}"));
            let weight = self.array(graph, &format!("{name}.weight"))?;
            let bias = self.array(graph, &format!("{name}.bias"))?;
            let product = graph.node("MatMul", &[&features, &weight], &[]);
            let sum = graph.node("Add", &[&product, &bias], &[]);
            features = graph.node("Relu", &[&sum], &[]);
        }
        let features = graph.node("Mul", &[&features, &present], &[]);
        let axis = graph.whole(&[1]);
        let flat = [Attribute::Int("keepdims", 0)];
        let count = graph.node("ReduceSum", &[&present, &axis], &flat);
        let sum = graph.node("ReduceSum", &[&features, &axis], &flat);
        let at_least_one = graph.node("Max", &[&count, &one], &[]);
        let mean = graph.node("Div", &[&sum, &at_least_one], &[]);
        // Features are not negative, so absent things are never the only maximum.
        let most = graph.node("ReduceMax", &[&features, &axis], &flat);
        let more = graph.node("Add", &[&count, &one], &[]);
        let logarithm = graph.node("Log", &[&more], &[]);
        parts.extend([mean, most, logarithm]);
        Ok(())
    }

    /// Applies the recurrent layer to one tick, and returns the state after it, `[batch, hidden]`.
    fn gru(&self, graph: &mut Graph, x: &str, before: &str, hidden: usize) -> Result<String, OnnxError> {
        let weights = |graph: &mut Graph, part: &str| -> Result<String, OnnxError> {
            let name = self.name(&format!("memory.l0.{part}"));
            let (shape, numbers) = self.form.single(&name)?;
            let rows = shape.get(1).copied().unwrap_or_default();
            let gates = gates_first(numbers, rows, hidden);
            Ok(graph.floats(&name, &[1, 3 * hidden, rows], &gates))
        };
        let (input, recurrent) = (weights(graph, "weight_ih")?, weights(graph, "weight_hh")?);
        let bias = [self.name("memory.l0.bias_ih"), self.name("memory.l0.bias_hh")];
        let mut both = Vec::with_capacity(6 * hidden);
        for name in &bias {
            both.extend(gates_first(self.form.single(name)?.1, 1, hidden));
        }
        let bias = graph.floats(&self.name("memory.l0.bias"), &[1, 6 * hidden], &both);
        let (x, before) = (graph.reaxis("Unsqueeze", x, 0), graph.reaxis("Unsqueeze", before, 0));
        let state = graph.gru(&[&x, &input, &recurrent, &bias, "", &before], hidden);
        Ok(graph.reaxis("Squeeze", &state, 0))
    }

    /// Turns pixels into features.
    fn trunk(&self, graph: &mut Graph, cnn: &CnnKind, pixels: &str) -> Result<String, OnnxError> {
        let full = graph.floats("white", &[], &[255.0]);
        let x = graph.cast(pixels, data_type::FLOAT);
        let mut x = graph.node("Div", &[&x, &full], &[]);
        match cnn {
            CnnKind::Nature { .. } => {
                for (layer, stride) in NATURE_STRIDES.into_iter().enumerate() {
                    let y = self.conv(graph, &format!("cnn.conv{layer}"), &x, stride, 0)?;
                    x = graph.node("Relu", &[&y], &[]);
                }
            }
            CnnKind::Impala { channels, .. } => {
                for stage in 0..channels.len() {
                    let y = self.conv(graph, &format!("cnn.s{stage}.conv"), &x, 1, 1)?;
                    let window = [
                        Attribute::Ints("kernel_shape", &[3, 3]),
                        Attribute::Ints("strides", &[2, 2]),
                        Attribute::Ints("pads", &[1; 4]),
                    ];
                    x = graph.node("MaxPool", &[&y], &window);
                    for block in 0..2 {
                        let mut y = x.clone();
                        for conv in 0..2 {
                            let active = graph.node("Relu", &[&y], &[]);
                            y = self.conv(graph, &format!("cnn.s{stage}.res{block}.conv{conv}"), &active, 1, 1)?;
                        }
                        x = graph.node("Add", &[&x, &y], &[]);
                    }
                }
                x = graph.node("Relu", &[&x], &[]);
            }
        }
        let flat = graph.node("Flatten", &[&x], &[Attribute::Int("axis", 1)]);
        let features = self.linear(graph, &self.name("cnn.fc"), &flat)?;
        Ok(graph.node("Relu", &[&features], &[]))
    }

    fn conv(&self, graph: &mut Graph, name: &str, x: &str, stride: usize, pad: usize) -> Result<String, OnnxError> {
        let name = self.name(name);
        let weight = self.array(graph, &format!("{name}.weight"))?;
        let bias = self.array(graph, &format!("{name}.bias"))?;
        let side = self.form.single(&format!("{name}.weight"))?.0.last().copied().unwrap_or_default();
        let attributes = [
            Attribute::Ints("kernel_shape", &[side, side]),
            Attribute::Ints("strides", &[stride, stride]),
            Attribute::Ints("pads", &[pad; 4]),
        ];
        Ok(graph.node("Conv", &[x, &weight, &bias], &attributes))
    }
}

/// Returns the weights of a recurrent layer as ONNX has them: `[rows, reset | update | new]`, row by row, becomes
/// `[update | reset | new, rows]`.
pub(crate) fn gates_first(numbers: &[f32], rows: usize, hidden: usize) -> Vec<f32> {
    let mut out = Vec::with_capacity(numbers.len());
    for gate in [1, 0, 2] {
        for unit in gate * hidden..(gate + 1) * hidden {
            out.extend((0..rows).map(|row| numbers.get(row * 3 * hidden + unit).copied().unwrap_or_default()));
        }
    }
    out
}
