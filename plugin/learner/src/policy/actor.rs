//! The network of a distribution over actions.

use crate::{
    ActionSpace, FileError, LearnError, MixedSpace, ObsKind, PolicySpec,
    file::TensorFile,
    nn::{
        CnnKind, Dist, ImageNet, Init, Linear, Mlp, ObsBatch, ParamSource, ParamVisitor, Parameters, RandomInit,
        bounded_log_std, frozen, matrix, path,
    },
    policy::{
        NetInput,
        entities::{ENTITIES, EntityEncoder, EntityKind, EntityShape},
        memory::{Memory, MemoryShape, Recall},
    },
    rng::Streams,
};
use burn::tensor::{Device, Tensor};
use playbot_kernels::elementwise::Activation;
use rand::Rng;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Name of the memory, behind the name of its actor.
const MEMORY: &str = "memory";

/// Bounds of a state-dependent log-std.
const LOG_STD_RANGE: (f32, f32) = (-10.0, 2.0);

/// The source of a Gaussian's standard deviation.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum StdKind {
    /// One learned vector for all states (the SCORE paper's released form).
    Vector,
    /// A second head, clamped to ln σ in [-10, 2] (OPAL's form).
    State,
}

/// The part of a Gaussian actor that computes ln σ.
#[derive(Clone, Debug)]
pub enum LogStd {
    /// Absent, for discrete actions.
    None,
    /// The same for all states, `[dim]`.
    Vector(Tensor<1>),
    /// From the last hidden layer.
    State(Linear),
    /// From the last hidden layer and bounded smoothly, for a squashed Gaussian: the action is the tanh of the normal
    /// number (Haarnoja et al. 2018, "Soft actor-critic algorithms and applications").
    Squashed {
        /// Computes the raw number under [`bounded_log_std`].
        layer: Linear,
        /// Bounds of ln σ.
        range: (f64, f64),
    },
}

/// π(a | s, z): input `[z, s]`, hidden layers, and a head of logits or means. A trunk of convolutions turns images
/// into features first.
///
/// The skill decoder and the policy are of this type, so that a policy can start as an exact copy of the decoder. The
/// prior over skills is of it, too: its action is the latent.
#[derive(Clone, Debug)]
pub struct Actor {
    /// The trunk that reads images, `cnn` in names; `None` for vectors.
    pub cnn: Option<ImageNet>,
    /// The encoder of sets of things in vectors, `entities` in names, which actor and critic share; `None` without sets.
    pub entities: Option<EntityEncoder>,
    /// The memory, `memory` in names, which actor and critic share; `None` without.
    pub memory: Option<Memory>,
    /// Hidden layers and the head.
    pub net: Mlp,
    /// ln σ, for continuous actions.
    pub log_std: LogStd,
    /// The actions that its head describes.
    pub space: ActionSpace,
}

impl Actor {
    /// Creates an actor with orthogonal weights (gain √2 in the hidden layers, 0.01 in the head) and ln σ = 0.
    pub fn new<R: Rng + ?Sized>(
        shape: &NetShape,
        space: ActionSpace,
        std: StdKind,
        rng: &mut R,
        device: &Device,
    ) -> Self {
        let Ok(actor) = Self::build(&mut RandomInit { rng, device }, "", shape, space, std.into());
        actor
    }

    /// Creates an actor of logits, or of a squashed Gaussian with ln σ within `log_std_range`. Orthogonal weights as
    /// in [`Self::new`].
    pub fn squashed<R: Rng + ?Sized>(
        shape: &NetShape,
        space: ActionSpace,
        log_std_range: (f64, f64),
        rng: &mut R,
        device: &Device,
    ) -> Self {
        let std = StdShape::Squashed(log_std_range.0, log_std_range.1);
        let Ok(actor) = Self::build(&mut RandomInit { rng, device }, "", shape, space, std);
        actor
    }

    /// Creates an actor without a trunk, with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        shape: &NetShape,
        space: ActionSpace,
        std: StdShape,
    ) -> Result<Self, S::Error> {
        let (inputs, dim) = (shape.inputs(), space.dim());
        let net = Mlp::build(source, prefix, inputs, &shape.hidden, dim, shape.activation, 0.01)?;
        let name = path(prefix, "log_std");
        let numbers = space.numbers();
        let mut layer = || Linear::build(source, &name, shape.hidden.last().copied().unwrap_or(inputs), numbers, 0.01);
        let log_std = match std {
            _ if numbers == 0 => LogStd::None,
            StdShape::State => LogStd::State(layer()?),
            StdShape::Squashed(low, high) => LogStd::Squashed { layer: layer()?, range: (low, high) },
            StdShape::Vector => LogStd::Vector(source.param(&name, [numbers], Init::Zeros)?),
        };
        Ok(Self { cnn: None, entities: None, memory: None, net, log_std, space })
    }

    /// Adds a memory, behind skills of width `latent`, that has no effect on the outputs yet.
    pub(crate) fn with_new_memory(
        mut self,
        latent: usize,
        shape: MemoryShape,
        mut source: RandomInit<'_, impl Rng>,
    ) -> Self {
        let seen = self.obs_dim(latent);
        let Ok(memory) = Memory::build(&mut source, "", (latent, seen), shape);
        self.net.add_inputs(shape.width(seen));
        Self { memory: Some(memory), ..self }
    }

    /// Returns the width of what its layers read behind a skill of width `latent`: the numbers of a vector, with the
    /// features of its sets, or the features of an image, and the memory.
    pub(crate) fn obs_dim(&self, latent: usize) -> usize {
        self.net.inputs() - latent
    }

    /// Returns whether its actions are the tanh of the normal numbers whose distribution [`Self::forward`] returns.
    pub fn is_squashed(&self) -> bool {
        matches!(self.log_std, LogStd::Squashed { .. })
    }

    /// Returns the input of the layers behind the trunk, `[n, obs_dim]`: vectors unchanged except for their sets, images
    /// as features.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the observations are of the other kind than the network; [`LearnError::Device`] if sets
    /// cannot be read.
    pub fn observe(&self, states: &ObsBatch) -> Result<Tensor<2>, LearnError> {
        match (&self.cnn, states) {
            (None, ObsBatch::Vector(x)) => match &self.entities {
                Some(entities) => entities.forward(x.clone()),
                None => Ok(x.clone()),
            },
            (Some(cnn), ObsBatch::Image(x)) => Ok(cnn.forward(x.clone())),
            (None, ObsBatch::Image(_)) => Err(LearnError::Config("a network for vectors got images".to_owned())),
            (Some(_), ObsBatch::Vector(_)) => Err(LearnError::Config("a network for images got vectors".to_owned())),
        }
    }

    /// Returns the rows `[z, s]`, `[n, latent + obs_dim]`, that the layers of actor and critic read; images become
    /// features first.
    ///
    /// # Errors
    /// As [`Self::observe`].
    pub fn join(&self, input: &NetInput) -> Result<Tensor<2>, LearnError> {
        let (z, pixels) = match input {
            NetInput::Joined(x) => return self.observe(&ObsBatch::Vector(x.clone())),
            NetInput::Images { z, pixels } => (z, pixels),
        };
        let features = self.observe(&ObsBatch::Image(pixels.clone()))?;
        Ok(match z {
            None => features,
            Some(z) => Tensor::cat(vec![z.clone(), features], 1),
        })
    }

    /// Returns joined inputs with the memory of each behind them, for an actor with memory; other inputs unchanged.
    ///
    /// # Errors
    /// As [`Self::observe`], for the ticks before the sequences.
    pub fn recall(&self, x: Tensor<2>, recall: Option<&Recall>) -> Result<Tensor<2>, LearnError> {
        let (Some(memory), Some(recall)) = (&self.memory, recall) else { return Ok(x) };
        let mut initial = recall.initial.clone();
        if let Some(burn_in) = &recall.burn_in {
            let past = frozen(self);
            let memory = frozen(memory);
            initial = memory.warm(past.join(&burn_in.inputs)?, burn_in, initial);
        }
        Ok(memory.recall(x, recall, initial))
    }

    /// Remembers one tick of `n` agents. Takes joined inputs, `[n, latent + obs_dim]`, and the numbers that they
    /// remembered before, `n * width`, or none for agents that begin anew. Returns what the layers read, and what is
    /// remembered after, `[n, width]`; `None` without memory.
    ///
    /// Both have at least two rows. Matrix libraries sum a single row in another order than the rows of a matrix, and a
    /// lone agent must act like one of many.
    pub(crate) fn remember(
        &self,
        x: Tensor<2>,
        before: &[f32],
        n: usize,
        device: &Device,
    ) -> (Tensor<2>, Option<Tensor<2>>) {
        let x = if n == 1 { x.repeat_dim(0, 2) } else { x };
        let Some(memory) = &self.memory else { return (x, None) };
        let width = memory.width();
        let mut before = before.to_vec();
        before.resize(n * width, 0.0);
        if n == 1 {
            before.extend_from_within(..);
        }
        let (x, after) = memory.step(x, matrix(before, n.max(2), width, device));
        (x, Some(after))
    }

    /// Returns the distributions for joined inputs `[z, s]`, `[n, latent + obs_dim]`, where s is the result of
    /// [`Self::observe`]. Behind them is the memory, if there is one.
    pub fn forward(&self, x: Tensor<2>) -> Dist {
        self.forward_legal(x, None)
    }

    /// Does [`Self::forward`] with numbers that are added to the logits, `[n, options]`, if there are any: 0 for legal
    /// choices, and for illegal ones a negative number so large that their probability is 0.
    pub fn forward_legal(&self, x: Tensor<2>, logit_offsets: Option<&Tensor<2>>) -> Dist {
        self.head(self.net.features(x), logit_offsets)
    }

    /// Returns the distributions for skills `z` `[B, latent]` that are each used for `steps` observations. Row `t * B
    /// + b` of `states` `[steps * B, obs_dim]`, the result of [`Self::observe`], goes with row `b` of `z`.
    pub fn forward_held(&self, z: Tensor<2>, states: Tensor<2>, steps: usize) -> Dist {
        self.head(self.net.features_held(z, states, steps), None)
    }

    fn head(&self, features: Tensor<2>, logit_offsets: Option<&Tensor<2>>) -> Dist {
        let head = self.net.head.forward(features.clone());
        match self.space {
            ActionSpace::Discrete(_) => categorical(head, logit_offsets.cloned()),
            ActionSpace::Continuous(_) => self.gaussian(head, features),
            ActionSpace::Mixed(MixedSpace { choices, numbers }) => {
                let columns = |of: &Tensor<2>, at: &Range<usize>| of.clone().narrow(1, at.start, at.len());
                let choice = |at| categorical(columns(&head, &at), logit_offsets.map(|offsets| columns(offsets, &at)));
                let mut parts: Vec<Dist> = choices.ranges().map(choice).collect();
                if numbers > 0 {
                    let options = choices.options();
                    parts.push(self.gaussian(columns(&head, &(options..options + numbers)), features));
                }
                Dist::Joint(parts)
            }
        }
    }

    /// Returns the normal distributions with these means.
    fn gaussian(&self, head: Tensor<2>, features: Tensor<2>) -> Dist {
        match &self.log_std {
            // Where there are numbers there is ln σ.
            LogStd::None => Dist::Gaussian { log_std: head.zeros_like(), mean: head, free: None },
            LogStd::Vector(log_std) => Dist::Gaussian { mean: head, log_std: log_std.clone().unsqueeze(), free: None },
            LogStd::State(layer) => {
                let (low, high) = LOG_STD_RANGE;
                Dist::Gaussian { mean: head, log_std: layer.forward(features).clamp(low, high), free: None }
            }
            LogStd::Squashed { layer, range } => {
                Dist::Gaussian { mean: head, log_std: bounded_log_std(layer.forward(features), *range), free: None }
            }
        }
    }
}

/// Returns the choices of these logits, with numbers that are added to them.
fn categorical(logits: Tensor<2>, offsets: Option<Tensor<2>>) -> Dist {
    Dist::categorical(match offsets {
        Some(offsets) => logits + offsets,
        None => logits,
    })
}

impl Parameters for Actor {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        if let Some(cnn) = &mut self.cnn {
            cnn.visit(&path(prefix, "cnn"), visitor);
        }
        if let Some(entities) = &mut self.entities {
            entities.visit(&path(prefix, ENTITIES), visitor);
        }
        if let Some(memory) = &mut self.memory {
            memory.visit(&path(prefix, MEMORY), visitor);
        }
        self.net.visit(prefix, visitor);
        match &mut self.log_std {
            LogStd::None => {}
            LogStd::Vector(tensor) => visitor.visit(&path(prefix, "log_std"), tensor),
            LogStd::State(layer) | LogStd::Squashed { layer, .. } => layer.visit(&path(prefix, "log_std"), visitor),
        }
    }
}

// The network that estimates the return.

/// V(s, z): the actor's input and hidden layers, one output. For images it reads the features of the actor's trunk,
/// which is trained by the losses of both.
///
/// The value depends on the remaining ticks of the skill. With `clock` it is V(s, z) + c · C(s, z), where c is the
/// [remaining share of its ticks](crate::Rollout::left).
#[derive(Clone, Debug)]
pub struct Critic {
    /// Hidden layers and the head.
    pub net: Mlp,
    /// A second head, C; `None` if ticks are not counted.
    pub clock: Option<Linear>,
}

impl Critic {
    /// Creates a critic with orthogonal weights, gain √2 in the hidden layers and 1 in the head.
    pub fn new<R: Rng + ?Sized>(shape: &NetShape, rng: &mut R, device: &Device) -> Self {
        let Ok(critic) = Self::build(&mut RandomInit { rng, device }, "", shape);
        critic
    }

    /// Creates a critic as [`Self::new`], with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(source: &mut S, prefix: &str, shape: &NetShape) -> Result<Self, S::Error> {
        let net = Mlp::build(source, prefix, shape.inputs(), &shape.hidden, 1, shape.activation, 1.0)?;
        Ok(Self { net, clock: None })
    }

    /// Adds a clock that has no effect yet, or the one of `source`.
    pub(crate) fn with_clock<S: ParamSource>(self, source: &mut S, prefix: &str) -> Result<Self, S::Error> {
        let [width, _] = self.net.head.weight.dims();
        let name = path(prefix, CLOCK);
        let clock = Linear {
            weight: source.param(&path(&name, "weight"), [width, 1], Init::Zeros)?,
            bias: source.param(&path(&name, "bias"), [1], Init::Zeros)?,
        };
        Ok(Self { clock: Some(clock), ..self })
    }

    /// Returns the values of joined inputs `[z, s]`: `[n, latent + obs_dim]` to `[n]`. `left`, `[n]`, is the
    /// remaining share of each skill's ticks; without it all skills count as newly drawn.
    pub fn forward(&self, x: Tensor<2>, left: Option<Tensor<1>>) -> Tensor<1> {
        self.values_of(self.net.features(x), left)
    }

    /// Returns the values of [`Self::forward`] from the activations of the last hidden layer.
    pub(crate) fn values_of(&self, features: Tensor<2>, left: Option<Tensor<1>>) -> Tensor<1> {
        let values = self.net.head.number(features.clone());
        match (&self.clock, left) {
            (Some(clock), Some(left)) => values + clock.number(features) * left,
            (Some(clock), None) => values + clock.number(features),
            (None, _) => values,
        }
    }
}

/// Name of the second head, behind the name of its critic.
pub(crate) const CLOCK: &str = "clock";

impl Parameters for Critic {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.net.visit(prefix, visitor);
        if let Some(clock) = &mut self.clock {
            clock.visit(&path(prefix, CLOCK), visitor);
        }
    }
}

// The sizes of actors and critics, from which a fresh network is made or a stored one is read.

/// Sizes of an actor's layers behind its trunk, or of a critic.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug)]
pub struct NetShape {
    /// Width of the observation, or the number of features of an image, with the memory behind them.
    pub obs_dim: usize,
    /// Width of the skill z before the observation; 0 without skills.
    pub latent: usize,
    /// Width of each hidden layer.
    pub hidden: Vec<usize>,
    /// The function after each hidden layer.
    pub activation: Activation,
}

impl NetShape {
    /// Returns the width of `[z, s]`.
    pub(crate) fn inputs(&self) -> usize {
        self.latent.saturating_add(self.obs_dim)
    }

    /// Returns the sizes of `net`, which reads observations of `obs_dim` behind its skills.
    fn of(net: &Mlp, obs_dim: usize) -> Self {
        Self {
            obs_dim,
            latent: net.inputs() - obs_dim,
            hidden: net.layers.iter().map(|layer| layer.weight.dims()[1]).collect(),
            activation: net.activation,
        }
    }

    /// Returns the critic of this shape called `name`, out of a file.
    pub(crate) fn stored_critic(
        &self,
        file: &mut TensorFile,
        name: &str,
        device: &Device,
    ) -> Result<Critic, FileError> {
        let has_clock = file.has(&format!("{name}.{CLOCK}.weight"));
        let source = &mut file.params(device);
        let critic = Critic::build(source, name, self)?;
        if has_clock { critic.with_clock(source, name) } else { Ok(critic) }
    }
}

/// The source of an actor's standard deviation; without meaning for discrete actions.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub(crate) enum StdShape {
    /// One learned vector for all states.
    Vector,
    /// A second head.
    State,
    /// A second head, bounded smoothly between two numbers, of a squashed Gaussian.
    Squashed(f64, f64),
}

impl From<StdKind> for StdShape {
    fn from(kind: StdKind) -> Self {
        match kind {
            StdKind::Vector => Self::Vector,
            StdKind::State => Self::State,
        }
    }
}

/// The whole architecture of an actor, as policy files describe it.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields)]
pub(crate) struct ActorShape {
    pub(crate) net: NetShape,
    pub(crate) std: StdShape,
    /// The trunk that reads images; `None` for vectors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) cnn: Option<CnnKind>,
    /// The encoder of sets of things; `None` without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) entities: Option<EntityShape>,
    /// Its memory, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) memory: Option<MemoryShape>,
}

impl ActorShape {
    /// Creates an actor of `spec` with these hidden layers, and the trunk `cnn` if it observes images.
    pub(crate) fn new(
        spec: &PolicySpec,
        cnn: &CnnKind,
        hidden: &[usize],
        activation: Activation,
        std: StdShape,
    ) -> Self {
        let (obs_dim, cnn) = match spec.obs {
            ObsKind::Vector(width) => (width, None),
            ObsKind::Image(_) => (cnn.features(), Some(cnn.clone())),
        };
        let net = NetShape { obs_dim, latent: spec.latent, hidden: hidden.to_vec(), activation };
        Self { net, std, cnn, entities: None, memory: None }
    }

    /// Adds an encoder of the observation's sets, if it has any. A memory comes behind it.
    pub(crate) fn with_entities(mut self, entities: &EntityKind) -> Self {
        let shape = entities.shape(self.net.obs_dim).filter(|_| self.cnn.is_none());
        self.net.obs_dim = shape.as_ref().map_or(self.net.obs_dim, EntityShape::features);
        Self { entities: shape, ..self }
    }

    /// Adds a memory, if any.
    pub(crate) fn with_memory(mut self, memory: Option<MemoryShape>) -> Self {
        let width = memory.map_or(0, |memory| memory.width(self.net.obs_dim));
        self.net.obs_dim = self.net.obs_dim.saturating_add(width);
        Self { memory, ..self }
    }

    /// Returns the width of the observations behind the encoder of their sets, or the number of an image's features.
    pub(crate) fn seen(&self) -> usize {
        self.memory.map_or(self.net.obs_dim, |memory| memory.seen(self.net.obs_dim))
    }

    /// Returns the width of the vectors that it observes.
    pub(crate) fn observed(&self) -> usize {
        self.entities.as_ref().map_or_else(|| self.seen(), |entities| entities.obs_dim)
    }

    /// Returns the shape of `actor`, which reads skills of width `latent`.
    pub(crate) fn of(actor: &Actor, latent: usize) -> Self {
        let std = match actor.log_std {
            LogStd::None | LogStd::Vector(_) => StdShape::Vector,
            LogStd::State(_) => StdShape::State,
            LogStd::Squashed { range: (low, high), .. } => StdShape::Squashed(low, high),
        };
        Self {
            net: NetShape::of(&actor.net, actor.obs_dim(latent)),
            std,
            cnn: actor.cnn.as_ref().map(ImageNet::kind),
            entities: actor.entities.as_ref().map(EntityEncoder::shape),
            memory: actor.memory.as_ref().map(Memory::shape),
        }
    }

    /// Returns the shape of `critic`, which reads the same inputs as an actor of this shape.
    pub(crate) fn critic(&self, critic: &Critic) -> NetShape {
        NetShape::of(&critic.net, self.net.obs_dim)
    }

    /// Creates an actor with starting weights from the stream `name`, its trunk with some from `name.cnn`, and the encoder
    /// of its sets with some from `name.entities`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if images are too small for the trunk.
    pub(crate) fn fresh(
        &self,
        spec: &PolicySpec,
        streams: &Streams,
        name: &str,
        device: &Device,
    ) -> Result<Actor, LearnError> {
        let cnn = match (&self.cnn, spec.obs) {
            (Some(cnn), ObsKind::Image(image)) => {
                Some(ImageNet::new(cnn, image, &mut streams.stream(&format!("{name}.cnn"), 0), device)?)
            }
            _ => None,
        };
        let entities = self.entities.as_ref().map(|shape| {
            let mut rng = streams.stream(&path(name, ENTITIES), 0);
            let Ok(entities) = EntityEncoder::build(&mut RandomInit { rng: &mut rng, device }, "", shape);
            entities
        });
        let mut source = RandomInit { rng: &mut streams.stream(name, 0), device };
        let Ok(actor) = Actor::build(&mut source, "", &self.net, spec.action_space, self.std);
        let Ok(memory) = self.memory(&mut source, "");
        Ok(Actor { cnn, entities, memory, ..actor })
    }

    /// Reads the actor of this shape called `name` out of a file.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen, or the reason why the shape does not fit
    /// `spec`.
    pub(crate) fn stored(
        &self,
        spec: &PolicySpec,
        file: &mut TensorFile,
        name: &str,
        device: &Device,
    ) -> Result<Actor, FileError> {
        let cnn = match (&self.cnn, spec.obs) {
            (None, ObsKind::Vector(_)) => None,
            (Some(cnn), ObsKind::Image(image)) => {
                let prefix = path(name, "cnn");
                file.product(&prefix, &[image.channels, image.height, image.width])?;
                let net = ImageNet::build(&mut file.params(device), &prefix, cnn, image)?;
                let latent = self.net.latent;
                InputWidths { obs_dim: cnn.features(), latent }.check(file, name, self.seen_widths())?;
                Some(net)
            }
            (None, ObsKind::Image(_)) => {
                return Err(file.format(format!("`{name}` reads vectors, but must read images")));
            }
            (Some(_), ObsKind::Vector(_)) => {
                return Err(file.format(format!("`{name}` reads images, but must read vectors")));
            }
        };
        let entities = match &self.entities {
            None => None,
            Some(shape) => {
                let latent = self.net.latent;
                InputWidths { obs_dim: shape.features(), latent }.check(file, name, self.seen_widths())?;
                let prefix = path(name, ENTITIES);
                Some(EntityEncoder::stored(shape, &spec.obs, file, &prefix, device)?)
            }
        };
        let source = &mut file.params(device);
        let actor = Actor::build(source, name, &self.net, spec.action_space, self.std)?;
        Ok(Actor { cnn, entities, memory: self.memory(source, name)?, ..actor })
    }

    /// Creates the memory of the actor called `name`, if it has one, with parameters out of `source`.
    fn memory<S: ParamSource>(&self, source: &mut S, name: &str) -> Result<Option<Memory>, S::Error> {
        let widths = (self.net.latent, self.seen());
        let build = |shape| Memory::build(source, &path(name, MEMORY), widths, shape);
        // A damaged file may say anything.
        let memory = self.memory.filter(|shape| shape.width(self.seen()) > 0);
        memory.map(build).transpose()
    }

    /// Returns the widths of its inputs without the memory.
    fn seen_widths(&self) -> InputWidths {
        InputWidths { obs_dim: self.seen(), latent: self.net.latent }
    }
}

/// The inputs of a network: observations (or features of images) and skills of these widths.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct InputWidths {
    pub(crate) obs_dim: usize,
    pub(crate) latent: usize,
}

impl InputWidths {
    /// Checks that the network `name` reads exactly these widths.
    pub(crate) fn check(self, file: &TensorFile, name: &str, found: Self) -> Result<(), FileError> {
        if found == self {
            return Ok(());
        }
        let text = |widths: Self| format!("observations of {} and skills of {}", widths.obs_dim, widths.latent);
        Err(file.format(format!("`{name}` reads {}, but must read {}", text(found), text(self))))
    }
}

impl NetShape {
    /// Returns the widths of its inputs.
    pub(crate) fn input_widths(&self) -> InputWidths {
        InputWidths { obs_dim: self.obs_dim, latent: self.latent }
    }
}
