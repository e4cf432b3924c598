//! The network of a distribution over actions.

use super::{NetInput, NetShape, StdShape};
use crate::nn::{
    Dist, ImageNet, Init, Linear, Mlp, ObsBatch, ParamSource, ParamVisitor, Parameters, RandomInit, bounded_log_std,
    path,
};
use crate::{ActionSpace, LearnError};
use burn::tensor::{Device, Tensor};
use rand::Rng;
use serde::{Deserialize, Serialize};

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
    /// Hidden layers and the head.
    pub net: Mlp,
    /// ln σ, for continuous actions.
    pub log_std: LogStd,
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
        let mut layer = || Linear::build(source, &name, shape.hidden.last().copied().unwrap_or(inputs), dim, 0.01);
        let log_std = match (space, std) {
            (ActionSpace::Discrete(_), _) => LogStd::None,
            (ActionSpace::Continuous(_), StdShape::State) => LogStd::State(layer()?),
            (ActionSpace::Continuous(_), StdShape::Squashed(low, high)) => {
                LogStd::Squashed { layer: layer()?, range: (low, high) }
            }
            (ActionSpace::Continuous(_), StdShape::Vector) => {
                LogStd::Vector(source.param(&name, [dim], Init::Zeros)?)
            }
        };
        Ok(Self { cnn: None, net, log_std })
    }

    /// Returns the width of the observation behind a skill of width `latent`: the numbers of a vector, or the
    /// features of an image.
    pub(crate) fn obs_dim(&self, latent: usize) -> usize {
        self.net.inputs() - latent
    }

    /// Returns whether its actions are the tanh of the normal numbers whose distribution [`Self::forward`] returns.
    pub fn is_squashed(&self) -> bool {
        matches!(self.log_std, LogStd::Squashed { .. })
    }

    /// Returns the input of the layers behind the trunk, `[n, obs_dim]`: vectors unchanged, images as features.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the observations are of the other kind than the network.
    pub fn observe(&self, states: &ObsBatch) -> Result<Tensor<2>, LearnError> {
        match (&self.cnn, states) {
            (None, ObsBatch::Vector(x)) => Ok(x.clone()),
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

    /// Returns the distributions for joined inputs `[z, s]`, `[n, latent + obs_dim]`, where s is the result of
    /// [`Self::observe`].
    pub fn forward(&self, x: Tensor<2>) -> Dist {
        self.head(self.net.features(x))
    }

    /// Returns the distributions for skills `z` `[B, latent]` that are each used for `steps` observations. Row `t * B
    /// + b` of `states` `[steps * B, obs_dim]`, the result of [`Self::observe`], goes with row `b` of `z`.
    pub fn forward_held(&self, z: Tensor<2>, states: Tensor<2>, steps: usize) -> Dist {
        self.head(self.net.features_held(z, states, steps))
    }

    fn head(&self, features: Tensor<2>) -> Dist {
        let head = self.net.head.forward(features.clone());
        match &self.log_std {
            LogStd::None => Dist::categorical(head),
            LogStd::Vector(log_std) => Dist::Gaussian { mean: head, log_std: log_std.clone().unsqueeze() },
            LogStd::State(layer) => {
                let (low, high) = LOG_STD_RANGE;
                Dist::Gaussian { mean: head, log_std: layer.forward(features).clamp(low, high) }
            }
            LogStd::Squashed { layer, range } => {
                Dist::Gaussian { mean: head, log_std: bounded_log_std(layer.forward(features), *range) }
            }
        }
    }
}

impl Parameters for Actor {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        if let Some(cnn) = &mut self.cnn {
            cnn.visit(&path(prefix, "cnn"), visitor);
        }
        self.net.visit(prefix, visitor);
        match &mut self.log_std {
            LogStd::None => {}
            LogStd::Vector(tensor) => visitor.visit(&path(prefix, "log_std"), tensor),
            LogStd::State(layer) | LogStd::Squashed { layer, .. } => layer.visit(&path(prefix, "log_std"), visitor),
        }
    }
}
