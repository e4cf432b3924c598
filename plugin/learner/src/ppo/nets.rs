//! Actor and critic as one set of parameters.

use super::PpoConfig;
use crate::file::TensorFile;
use crate::learner::LearnerBase;
use crate::nn::{ParamVisitor, Parameters, RandomInit, path};
use crate::policy::{Actor, ActorShape, Critic, NetShape, StdShape};
use crate::{FileError, LearnError};

/// The networks of PPO: the parameters `actor.*` and `critic.*`, whose gradients are clipped together. The trunk of
/// images, `actor.cnn.*`, is the critic's too.
#[derive(Clone, Debug)]
pub struct PpoNets {
    /// The policy.
    pub actor: Actor,
    /// The value function.
    pub critic: Critic,
}

impl PpoNets {
    /// Creates a copy of the decoder, or starting weights from the stream `ppo.actor`, and a critic with some from
    /// `ppo.critic`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if images are too small for the convolutions.
    pub(super) fn fresh(config: &PpoConfig, base: &LearnerBase) -> Result<Self, LearnError> {
        let (shape, device) = (actor_shape(config, base), base.device.plain());
        let actor = match base.copied_teacher() {
            Some(teacher) => teacher.origin().clone(),
            None => shape.fresh(&base.spec, &base.streams, "ppo.actor", &device)?,
        };
        let mut rng = base.streams.stream("ppo.critic", 0);
        let critic = Critic::new(&critic_shape(config, &shape), &mut rng, &device);
        let counts = base.score_config().is_some_and(|score| score.critic_clock);
        let Ok(critic) =
            if counts { critic.with_clock(&mut RandomInit { rng: &mut rng, device: &device }, "") } else { Ok(critic) };
        Ok(Self { actor, critic })
    }

    /// Reads the networks of a checkpoint.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen.
    pub(super) fn stored(config: &PpoConfig, base: &LearnerBase, file: &mut TensorFile) -> Result<Self, FileError> {
        let (shape, device) = (actor_shape(config, base), base.device.plain());
        let actor = shape.stored(&base.spec, file, "actor", &device)?;
        Ok(Self { actor, critic: critic_shape(config, &shape).stored_critic(file, "critic", &device)? })
    }
}

/// Returns the layers of the network that it copies, if it is a copy, else those of the settings.
fn actor_shape(config: &PpoConfig, base: &LearnerBase) -> ActorShape {
    match base.copied_teacher() {
        Some(teacher) => teacher.shape(),
        None => ActorShape::new(&base.spec, &config.cnn, &config.hidden, config.activation, StdShape::Vector),
    }
}

/// Returns the shape of the critic, which reads the same inputs as the actor's layers, through layers of its own.
fn critic_shape(config: &PpoConfig, actor: &ActorShape) -> NetShape {
    NetShape { hidden: config.hidden.clone(), activation: config.activation, ..actor.net }
}

impl Parameters for PpoNets {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        self.actor.visit(&path(prefix, "actor"), visitor);
        self.critic.visit(&path(prefix, "critic"), visitor);
    }
}
