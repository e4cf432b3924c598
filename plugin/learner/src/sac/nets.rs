//! The networks of SAC: an actor, two critics and their targets, and ln α.

use crate::LearnError;
use crate::nn::{ActionRows, Mlp, ParamVisitor, Parameters, frozen, path, tracked, vector};
use crate::policy::{Actor, NetShape};
use crate::rng::Streams;
use crate::{ActionSpace, DeviceKind};
use burn::tensor::{Device, Tensor};
use rand::Rng;

/// Twin Q-functions, `q1.*` and `q2.*`, each a network of its own.
///
/// Continuous: input `[z, s, a]`, one output. Discrete: input `[z, s]`, one output per choice.
#[derive(Clone, Debug)]
pub struct Critics {
    /// Q₁.
    pub q1: Mlp,
    /// Q₂.
    pub q2: Mlp,
}

impl Critics {
    /// Orthogonal weights, gain √2 in the hidden layers and 1 in the heads.
    pub fn new<R: Rng + ?Sized>(shape: &NetShape, space: ActionSpace, rng: &mut R, device: &Device) -> Self {
        let inputs = shape.latent + shape.obs_dim;
        let (inputs, outputs) = match space {
            ActionSpace::Discrete(choices) => (inputs, choices),
            ActionSpace::Continuous(dim) => (inputs + dim, 1),
        };
        let mut net = || Mlp::new(inputs, &shape.hidden, outputs, shape.activation, 1.0, rng, device);
        Self { q1: net(), q2: net() }
    }

    /// Q₁ and Q₂ of all choices in each state `[z, s]`, `[n, choices]` each.
    pub fn of_choices(&self, inputs: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
        (self.q1.forward(inputs.clone()), self.q2.forward(inputs))
    }

    /// Q₁ and Q₂ of one vector `[n, dim]` in each state `[z, s]`, `[n]` each.
    pub fn of_vectors(&self, inputs: Tensor<2>, actions: Tensor<2>) -> (Tensor<1>, Tensor<1>) {
        let joined = Tensor::cat(vec![inputs, actions], 1);
        (self.q1.forward(joined.clone()).squeeze_dim(1), self.q2.forward(joined).squeeze_dim(1))
    }

    /// Q₁ and Q₂ of the actions taken, `[n]` each.
    pub fn of_actions(&self, inputs: Tensor<2>, actions: &ActionRows) -> (Tensor<1>, Tensor<1>) {
        match actions {
            ActionRows::Continuous(vectors) => self.of_vectors(inputs, vectors.clone()),
            ActionRows::Discrete(index) => {
                let (q1, q2) = self.of_choices(inputs);
                (q1.gather(1, index.clone()).squeeze_dim(1), q2.gather(1, index.clone()).squeeze_dim(1))
            }
        }
    }
}

impl Parameters for Critics {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.q1.visit(&path(prefix, "q1"), visitor);
        self.q2.visit(&path(prefix, "q2"), visitor);
    }
}

/// ln α, `[1]`.
#[derive(Clone, Debug)]
pub struct LogAlpha(pub Tensor<1>);

impl Parameters for LogAlpha {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        visitor.visit(&path(prefix, "log_alpha"), &mut self.0);
    }
}

/// Everything that SAC trains.
#[derive(Clone, Debug)]
pub struct SacNets {
    /// The policy, tracked.
    pub actor: Actor,
    /// The critics, tracked.
    pub critics: Critics,
    /// Their slow copies, not tracked.
    pub targets: Critics,
    /// ln α, tracked; does nothing where α is fixed.
    pub log_alpha: LogAlpha,
}

impl SacNets {
    /// Starting weights, from streams of their own for actor and critics; `copy` takes the place of a fresh actor.
    pub fn new(
        shape: &NetShape,
        space: ActionSpace,
        log_std: (f64, f64),
        copy: Option<Actor>,
        initial_alpha: f64,
        streams: &Streams,
        device: DeviceKind,
    ) -> Self {
        let plain = device.plain();
        let actor =
            copy.unwrap_or_else(|| Actor::squashed(shape, space, log_std, &mut streams.stream("sac.actor", 0), &plain));
        let critics = Critics::new(shape, space, &mut streams.stream("sac.critics", 0), &plain);
        let log_alpha = LogAlpha(vector(vec![initial_alpha.ln() as f32], &plain));
        Self {
            actor: tracked(&actor),
            targets: frozen(&critics),
            critics: tracked(&critics),
            log_alpha: tracked(&log_alpha),
        }
    }

    /// α = exp(ln α).
    ///
    /// # Errors
    /// [`LearnError::Device`] if it cannot be read.
    pub fn alpha(&self) -> Result<f64, LearnError> {
        Ok(f64::from(crate::nn::scalar(self.log_alpha.0.clone().inner())?).exp())
    }
}
