//! Explorers: players that act where nothing is known yet.

use bevy::prelude::*;
use bevy_playbot::{
    policy::{ActionDraw, ActivePolicy},
    skill_prior::SkillPrior,
};
use playbot_learner::Policy;

/// The player that explores from a cell.
#[derive(Clone, Default)]
#[allow(clippy::large_enum_variant, reason = "one per exploration")]
pub enum Explorer {
    /// Uniformly random actions, each repeated with the plan's probability: no training, and no knowledge of the game.
    #[default]
    Random,
    /// A policy, with skills if it has any.
    Policy {
        /// The policy.
        policy: Policy,
        /// The source of its skills.
        prior: Option<SkillPrior>,
        /// How actions are drawn.
        draw: ActionDraw,
    },
}

impl Explorer {
    /// Creates an explorer with skills drawn from a prior, and played by a decoder.
    pub fn skills(prior: SkillPrior, decoder: Policy) -> Self {
        Self::Policy { policy: decoder, prior: Some(prior), draw: ActionDraw::Sample }
    }

    /// Returns its kind in words.
    pub fn describe(&self) -> &'static str {
        match self {
            Self::Random => "random actions",
            Self::Policy { prior: Some(_), .. } => "skills",
            Self::Policy { prior: None, .. } => "a policy",
        }
    }

    /// Returns whether a policy decides.
    pub(super) fn is_policy(&self) -> bool {
        matches!(self, Self::Policy { .. })
    }

    /// Installs the explorer's networks in a World, once.
    pub(super) fn install(&self, world: &mut World) {
        if let Self::Policy { policy, prior, draw } = self {
            ActivePolicy { policy: policy.clone(), draw: *draw }.install(world, prior.clone());
        }
    }
}
