//! Algorithms, by name.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use bevy_playbot::unknown_name::UnknownName;

/// An algorithm that makes a policy. Files and the command line use its [`name`](Self::name).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Algorithm {
    /// PPO with skills: the paper's method.
    ScorePpo,
    /// PPO without skills: the same network, steps and tuning.
    Ppo,
    /// SAC with skills: the decoder's penalty under SAC.
    ScoreSac,
    /// SAC without skills.
    Sac,
    /// Policy over skills by PPO (SPiRL): it learns which skill the decoder plays.
    SpirlPpo,
    /// Policy over skills by SAC.
    SpirlSac,
    /// SAC with recordings in each batch (RLPD).
    Rlpd,
    /// Behaviour cloning: the skill model's decoder under its prior, as learned from demonstrations.
    BehaviourCloning,
}

impl Algorithm {
    /// All algorithms.
    pub const ALL: [Self; 8] = [
        Self::ScorePpo,
        Self::Ppo,
        Self::ScoreSac,
        Self::Sac,
        Self::SpirlPpo,
        Self::SpirlSac,
        Self::Rlpd,
        Self::BehaviourCloning,
    ];

    /// Algorithms that learn from play, see [`is_trained`](Self::is_trained).
    pub const TRAINED: [Self; 7] =
        [Self::ScorePpo, Self::Ppo, Self::ScoreSac, Self::Sac, Self::SpirlPpo, Self::SpirlSac, Self::Rlpd];

    /// Returns the name on the command line, in files and in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::ScorePpo => "score-ppo",
            Self::Ppo => "ppo",
            Self::ScoreSac => "score-sac",
            Self::Sac => "sac",
            Self::SpirlPpo => "spirl-ppo",
            Self::SpirlSac => "spirl-sac",
            Self::Rlpd => "rlpd",
            Self::BehaviourCloning => "bc",
        }
    }

    /// Returns whether a skill model is needed.
    pub fn needs_skills(self) -> bool {
        match self {
            Self::ScorePpo | Self::ScoreSac | Self::SpirlPpo | Self::SpirlSac | Self::BehaviourCloning => true,
            Self::Ppo | Self::Sac | Self::Rlpd => false,
        }
    }

    /// Returns whether it learns which skill to play, instead of drawing it from the prior.
    pub fn learns_prior(self) -> bool {
        matches!(self, Self::SpirlPpo | Self::SpirlSac)
    }

    /// Returns whether it needs recordings, for skills or for its own training.
    pub fn learns_from_demos(self) -> bool {
        self.needs_skills() || self.trains_on_demos()
    }

    /// Returns whether it trains on recordings too; skills are learned from them beforehand.
    pub fn trains_on_demos(self) -> bool {
        self == Self::Rlpd
    }

    /// Returns the learner whose settings apply. Behaviour cloning trains no learner; it has the settings of PPO.
    pub fn learner(self) -> LearnerKind {
        match self {
            Self::ScorePpo | Self::Ppo | Self::SpirlPpo | Self::BehaviourCloning => LearnerKind::Ppo,
            Self::ScoreSac | Self::Sac | Self::SpirlSac | Self::Rlpd => LearnerKind::Sac,
        }
    }

    /// Returns whether it learns from play; other algorithms are ready once they have their skills.
    pub fn is_trained(self) -> bool {
        self != Self::BehaviourCloning
    }
}

/// The learner behind an algorithm. Dependent code matches every variant, so the compiler lists the places for a new
/// learner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LearnerKind {
    /// Proximal policy optimisation.
    Ppo,
    /// Soft actor-critic.
    Sac,
}

impl LearnerKind {
    /// Returns the key of its settings in an experiment.
    pub fn key(self) -> &'static str {
        match self {
            Self::Ppo => "ppo",
            Self::Sac => "sac",
        }
    }
}

impl fmt::Display for Algorithm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Algorithm {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let names = Self::ALL.map(Self::name);
        Self::ALL
            .into_iter()
            .find(|algorithm| algorithm.name() == name)
            .ok_or_else(|| UnknownName::new("algorithm", name, &names))
    }
}

impl TryFrom<String> for Algorithm {
    type Error = UnknownName;

    fn try_from(name: String) -> Result<Self, UnknownName> {
        name.parse()
    }
}

impl From<Algorithm> for String {
    fn from(algorithm: Algorithm) -> Self {
        algorithm.name().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn those_that_are_trained_are_all_but_cloning() {
        let trained: Vec<_> = Algorithm::ALL.into_iter().filter(|algorithm| algorithm.is_trained()).collect();
        assert_eq!(trained, Algorithm::TRAINED);
    }
}
