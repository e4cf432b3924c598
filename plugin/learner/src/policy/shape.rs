//! The sizes of actors and critics, from which a fresh network is made or a stored one is read.

use super::critic::CLOCK;
use super::{Actor, Critic, LogStd, StdKind};
use crate::file::TensorFile;
use crate::nn::{Activation, CnnKind, ImageNet, Mlp, RandomInit, path};
use crate::rng::Streams;
use crate::{FileError, LearnError, ObsKind, PolicySpec};
use burn::tensor::Device;
use serde::{Deserialize, Serialize};

/// Sizes of an actor's layers behind its trunk, or of a critic.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug)]
pub struct NetShape {
    /// Width of the observation, or the number of features of an image.
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
        Self { net: NetShape { obs_dim, latent: spec.latent, hidden: hidden.to_vec(), activation }, std, cnn }
    }

    /// Returns the shape of `actor`, which reads skills of width `latent`.
    pub(crate) fn of(actor: &Actor, latent: usize) -> Self {
        let std = match actor.log_std {
            LogStd::None | LogStd::Vector(_) => StdShape::Vector,
            LogStd::State(_) => StdShape::State,
            LogStd::Squashed { range: (low, high), .. } => StdShape::Squashed(low, high),
        };
        Self { net: NetShape::of(&actor.net, actor.obs_dim(latent)), std, cnn: actor.cnn.as_ref().map(ImageNet::kind) }
    }

    /// Returns the shape of `critic`, which reads the same inputs as an actor of this shape.
    pub(crate) fn critic(&self, critic: &Critic) -> NetShape {
        NetShape::of(&critic.net, self.net.obs_dim)
    }

    /// Creates an actor with starting weights from the stream `name`, and its trunk with some from `name.cnn`.
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
        let mut source = RandomInit { rng: &mut streams.stream(name, 0), device };
        let Ok(actor) = Actor::build(&mut source, "", &self.net, spec.action_space, self.std);
        Ok(Actor { cnn, ..actor })
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
                InputWidths { obs_dim: cnn.features(), latent }.check(file, name, self.net.input_widths())?;
                Some(net)
            }
            (None, ObsKind::Image(_)) => {
                return Err(file.format(format!("`{name}` reads vectors, but must read images")));
            }
            (Some(_), ObsKind::Vector(_)) => {
                return Err(file.format(format!("`{name}` reads images, but must read vectors")));
            }
        };
        let actor = Actor::build(&mut file.params(device), name, &self.net, spec.action_space, self.std)?;
        Ok(Actor { cnn, ..actor })
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
