//! What was scored, and how.

use serde::{Deserialize, Serialize};

use super::{clock::ClockKind, contestant::ContestantRecord};

/// Newest form of score files that is read and written.
pub const SCORE_FORMAT: u32 = 1;

/// Whatever the results of a score depend on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScoreRecord {
    /// Form of the file.
    pub format: u32,
    /// The set.
    pub set: SetRecord,
    /// Its games that were tested.
    pub games: Vec<GameRecord>,
    /// How.
    pub budget: ScoreBudget,
    /// What times were measured with.
    pub clock: ClockKind,
}

/// A set of mutants.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetRecord {
    /// Seed that it was made from.
    pub seed: u64,
    /// Hash of what is in it.
    pub hash: String,
}

/// A game, and who tests it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GameRecord {
    /// Name of the game.
    pub name: String,
    /// Version of its rules.
    pub version: u32,
    /// Who tests it.
    pub testers: Vec<ContestantRecord>,
    /// What looks for defects, each detector with its settings.
    pub detectors: Vec<String>,
    /// Names of those that the game brings itself and no other game has.
    #[serde(default)]
    pub own_detectors: Vec<String>,
}

/// How much each tester may do on each subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScoreBudget {
    /// Episodes of whoever plays.
    pub episodes: u32,
    /// Environment steps of whoever explores.
    pub steps: u64,
    /// Ways of whoever explores that are played again.
    pub routes: u32,
    /// Replays in which a finding is made shorter; 0 for none.
    pub replays: u32,
    /// Seed of all that is drawn.
    pub seed: u64,
}

impl Default for ScoreBudget {
    fn default() -> Self {
        Self { episodes: 5, steps: 50_000, routes: 8, replays: 100, seed: 0 }
    }
}

impl ScoreRecord {
    /// What differs between two scores, each in words.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let mut found = self.differences_of_way(other);
        if self.set != other.set {
            let words = |set: &SetRecord| format!("{} of seed {}", set.hash, set.seed);
            found.push(format!("sets {} and {}", words(&self.set), words(&other.set)));
        }
        if self.games != other.games {
            found.push(format!("games and testers {} and {}", self.describe_games(), other.describe_games()));
        }
        found
    }

    /// What differs in how they were made: scores of other games and sets can be joined all the same.
    pub fn differences_of_way(&self, other: &Self) -> Vec<String> {
        let mut found = Vec::new();
        let mut compare = |what: &str, one: String, other: String| {
            if one != other {
                found.push(format!("{what} {one} and {other}"));
            }
        };
        let (one, another) = (self.budget, other.budget);
        compare("forms", self.format.to_string(), other.format.to_string());
        compare("episodes", one.episodes.to_string(), another.episodes.to_string());
        compare("steps", one.steps.to_string(), another.steps.to_string());
        compare("routes", one.routes.to_string(), another.routes.to_string());
        compare("replays", one.replays.to_string(), another.replays.to_string());
        compare("seeds", one.seed.to_string(), another.seed.to_string());
        compare("clocks", self.clock.describe().to_owned(), other.clock.describe().to_owned());
        found
    }

    fn describe_games(&self) -> String {
        let tester = |tester: &ContestantRecord| {
            let sum = tester.checksum.as_ref().map_or_else(String::new, |sum| format!(" (file {sum})"));
            format!("{}{sum}{}", tester.name, if tester.greedy { " greedy" } else { "" })
        };
        let game = |game: &GameRecord| {
            let testers: Vec<String> = game.testers.iter().map(tester).collect();
            let (name, version) = (&game.name, game.version);
            format!("{name} {version} by {} under {}", testers.join(" + "), game.detectors.join(" + "))
        };
        self.games.iter().map(game).collect::<Vec<_>>().join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bugs::score::testing::record;

    #[test]
    fn what_differs_is_named_and_other_games_can_be_joined() {
        let one = record("garden", &["random"]);
        assert!(one.differences(&one).is_empty());
        let other = record("forest", &["random", "chaos"]);
        let words = one.differences(&other);
        assert!(
            words[0].contains("garden 1 by random") && words[0].contains("forest 1 by random + chaos"),
            "{words:?}"
        );
        assert!(one.differences_of_way(&other).is_empty());
        let budget = ScoreBudget { steps: 7, ..one.budget };
        assert_eq!(one.differences_of_way(&ScoreRecord { budget, ..one.clone() }), ["steps 50000 and 7"]);
    }
}
