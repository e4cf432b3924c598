//! Actor and critic as one set of parameters.

use crate::nn::{ParamVisitor, Parameters, path};
use crate::policy::{Actor, Critic};

/// What PPO trains: the parameters `actor.*` and `critic.*`, whose gradients are clipped together. The trunk of images,
/// `actor.cnn.*`, is the critic's too.
#[derive(Clone, Debug)]
pub struct PpoNets {
    /// The policy.
    pub actor: Actor,
    /// The value function.
    pub critic: Critic,
}

impl Parameters for PpoNets {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.actor.visit(&path(prefix, "actor"), visitor);
        self.critic.visit(&path(prefix, "critic"), visitor);
    }
}
