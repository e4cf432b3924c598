//! The start of PPO from another run's networks, normalisers and moments.

use crate::{
    LearnError, ObsKind, StartFrom, TakenOver,
    begin_from::{Fit, InputMap, take_moments, transplant},
    nn::{frozen, tracked},
    ppo::{PpoLearner, PpoNets, actor_shape},
    settings,
};

/// The reason for which an untrained critic is not taken.
const UNTRAINED: &str = "the other run has not trained it";

impl PpoLearner {
    /// Takes over the layers that fit, the normalisers, and Adam's moments if they are asked for.
    ///
    /// # Errors
    /// [`LearnError::Config`] names the part in which the policies differ, or says that no layer fits.
    pub(crate) fn take_over(&mut self, other: Self, start: &StartFrom<'_>) -> Result<TakenOver, LearnError> {
        let (own, theirs) = (self.base.spec, other.base.spec);
        let inputs = InputMap::between(start.inputs, theirs.obs, own.obs)?;
        let differs =
            |what: &str| Err(LearnError::Config(format!("it has {what} than the new run: give both the same")));
        if own.action_space != theirs.action_space {
            let (own, theirs) = (own.action_space, theirs.action_space);
            return Err(LearnError::Config(format!("its actions are {theirs}, and those of the new run are {own}")));
        }
        if own.latent != theirs.latent {
            return differs("skills of another width, or another `score.condition`,");
        }
        if self.base.observations.is_some() != other.base.observations.is_some() {
            let theirs = other.base.observations.is_some();
            return Err(LearnError::Config(format!(
                "its `ppo.norm_obs` is {theirs}, and that of the new run is {}: give it the same, with --set \
                 ppo.norm_obs={theirs}",
                !theirs
            )));
        }
        let (shape, their_shape) = (actor_shape(&self.config, &self.base), actor_shape(&other.config, &other.base));
        let memory = match (shape.memory, their_shape.memory) {
            (own, theirs) if own == theirs && (own.is_none() || inputs.is_same()) => 0,
            (Some(memory), None) if matches!(own.obs, ObsKind::Vector(_)) => memory.width(shape.seen()),
            (own, theirs) if own == theirs => {
                let text = "it has a memory, and what it remembers is of fewer inputs: a policy without memory can get \
                            more inputs";
                return Err(LearnError::Config(text.to_owned()));
            }
            _ => {
                let (own, theirs) = (settings::text(&self.config.memory), settings::text(&other.config.memory));
                return Err(LearnError::Config(format!(
                    "its `ppo.memory` is {theirs}, and that of the new run is {own}: give it the same, with --set \
                     'ppo.memory={theirs}'"
                )));
            }
        };
        let (behind, is_as_large) = inputs.behind(shape.entities.as_ref(), their_shape.entities.as_ref())?;
        let fit = Fit { inputs: &behind, latent: own.latent, memory, is_refused: None };
        let of_critic = Fit { is_refused: (!start.critic).then_some(UNTRAINED), ..fit };
        let mut nets = frozen(&self.nets);
        let mut report = transplant(&mut nets.actor, &other.nets.actor, "actor", fit)?;
        if report.taken.is_empty() {
            return Err(LearnError::Config(format!(
                "no layer of its policy fits: its hidden layers are {:?}, and those of the new run {:?}; give both the same, \
                 with --set 'ppo.hidden={:?}', or at least the same first one",
                their_shape.net.hidden, shape.net.hidden, their_shape.net.hidden
            )));
        }
        // A memory that is new has no effect yet.
        let lost = report.anew.iter().filter(|(layer, _)| memory == 0 || !layer.ends_with("memory")).count();
        let is_whole = lost == 0 && shape.net.activation == their_shape.net.activation;
        if shape.net.activation != their_shape.net.activation {
            let (own, theirs) = (shape.net.activation, their_shape.net.activation);
            tracing::warn!("the weights are taken, but behind {own:?} instead of {theirs:?} they are another policy");
        }
        report.join(transplant(&mut nets.critic, &other.nets.critic, "critic", of_critic)?);
        report.new_inputs = behind.fresh().count();
        self.take_curiosity(&mut nets, &other, &inputs, &mut report)?;
        report.is_same_policy = is_whole && behind.keeps_order() && is_as_large;
        if start.moments {
            let fits = [("actor", fit), ("critic", of_critic)];
            take_moments(&mut self.adam, &other.adam, &nets, &report.taken, &fits)?;
        }
        self.nets = tracked(&nets);
        self.base.observations = match own.obs {
            ObsKind::Vector(_) => other.base.observations.map(|normalizer| inputs.running_stats(normalizer)),
            ObsKind::Image(_) => other.base.observations,
        };
        if let (Some(own), Some(theirs)) = (&mut self.base.rewards, other.base.rewards) {
            own.stats = theirs.stats;
        }
        self.is_continuation = true;
        Ok(report)
    }
    /// Takes over what the other run's curiosity has learned, if it is about the same observations and the critic's
    /// layers were all taken. Curiosity that the other run did not have begins anew.
    fn take_curiosity(
        &mut self,
        nets: &mut PpoNets,
        other: &Self,
        inputs: &InputMap,
        report: &mut TakenOver,
    ) -> Result<(), LearnError> {
        let (Some(own), Some(theirs)) = (&mut self.curiosity, &other.curiosity) else { return Ok(()) };
        let is_alike = self.config.curiosity.predicts_like(&other.config.curiosity) && inputs.is_same();
        let features_are_taken = !report.anew.iter().any(|(layer, _)| layer.starts_with("critic.l"));
        match is_alike && features_are_taken {
            true => {
                own.take_over(theirs);
                nets.intrinsic.clone_from(&other.nets.intrinsic);
                report.taken.push("curiosity".to_owned());
            }
            false => report.anew.push(("curiosity".to_owned(), "another observation or network".to_owned())),
        }
        Ok(())
    }
}
