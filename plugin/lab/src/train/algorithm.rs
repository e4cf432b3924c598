//! Ways to make a policy, by name.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use bevy_playbot::unknown_name::UnknownName;

/// How a policy is made. Written as its [`name`](Self::name) in files and on the command line.
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
    /// A policy over skills by PPO (SPiRL): which skill the decoder plays is learned.
    SpirlPpo,
    /// A policy over skills by SAC.
    SpirlSac,
    /// SAC with recordings in each batch (RLPD).
    Rlpd,
    /// Behaviour cloning: the skill model's decoder under its prior, as learned from demonstrations.
    BehaviourCloning,
}

impl Algorithm {
    /// All of them.
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

    /// Those that learn from play, see [`is_trained`](Self::is_trained).
    pub const TRAINED: [Self; 7] =
        [Self::ScorePpo, Self::Ppo, Self::ScoreSac, Self::Sac, Self::SpirlPpo, Self::SpirlSac, Self::Rlpd];

    /// Name on the command line, in files and in results.
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

    /// Whether a skill model is needed.
    pub fn needs_skills(self) -> bool {
        match self {
            Self::ScorePpo | Self::ScoreSac | Self::SpirlPpo | Self::SpirlSac | Self::BehaviourCloning => true,
            Self::Ppo | Self::Sac | Self::Rlpd => false,
        }
    }

    /// Whether it learns which skill to play, instead of drawing it from the prior.
    pub fn learns_prior(self) -> bool {
        matches!(self, Self::SpirlPpo | Self::SpirlSac)
    }

    /// Whether there is nothing to learn without recordings: of skills, or of what was done.
    pub fn learns_from_demos(self) -> bool {
        self.needs_skills() || self.trains_on_demos()
    }

    /// Whether recordings are part of what it is trained on; skills are learned from them beforehand.
    pub fn trains_on_demos(self) -> bool {
        self == Self::Rlpd
    }

    /// The learner whose settings count. Behaviour cloning trains none; where settings are asked for, it has those of PPO.
    pub fn learner(self) -> LearnerKind {
        match self {
            Self::ScorePpo | Self::Ppo | Self::SpirlPpo | Self::BehaviourCloning => LearnerKind::Ppo,
            Self::ScoreSac | Self::Sac | Self::SpirlSac | Self::Rlpd => LearnerKind::Sac,
        }
    }

    /// Whether it learns from play; the others are ready as soon as they have their skills.
    pub fn is_trained(self) -> bool {
        self != Self::BehaviourCloning
    }
}

/// What improves a policy. Code that depends on it matches every variant, so that the compiler names what a new learner
/// needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LearnerKind {
    /// Proximal policy optimisation.
    Ppo,
    /// Soft actor-critic.
    Sac,
}

impl LearnerKind {
    /// The key of its settings in an experiment.
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
