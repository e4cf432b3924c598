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
    /// Behaviour cloning: the skill model's decoder under its prior, as learned from demonstrations.
    BehaviourCloning,
}

impl Algorithm {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::ScorePpo, Self::Ppo, Self::ScoreSac, Self::Sac, Self::BehaviourCloning];

    /// Those that learn from play, see [`is_trained`](Self::is_trained).
    pub const TRAINED: [Self; 4] = [Self::ScorePpo, Self::Ppo, Self::ScoreSac, Self::Sac];

    /// Name on the command line, in files and in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::ScorePpo => "score-ppo",
            Self::Ppo => "ppo",
            Self::ScoreSac => "score-sac",
            Self::Sac => "sac",
            Self::BehaviourCloning => "bc",
        }
    }

    /// Whether a skill model is needed.
    pub fn needs_skills(self) -> bool {
        matches!(self, Self::ScorePpo | Self::ScoreSac | Self::BehaviourCloning)
    }

    /// Whether it is of SAC's family, whose settings are the experiment's `sac`; `ppo` belongs to the other.
    pub fn is_sac(self) -> bool {
        matches!(self, Self::ScoreSac | Self::Sac)
    }

    /// Whether it learns from play; the others are ready as soon as they have their skills.
    pub fn is_trained(self) -> bool {
        self != Self::BehaviourCloning
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
