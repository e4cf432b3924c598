//! The record of a score: set, games, testers and settings.

use crate::score::contestant::{ClockKind, ContestantRecord};
use serde::{Deserialize, Serialize};

/// Newest form of score files that is read and written.
pub const SCORE_FORMAT: u32 = 1;

/// Everything that the results of a score depend on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScoreRecord {
    /// Form of the file.
    pub format: u32,
    /// The set.
    pub set: SetRecord,
    /// The games of the set that were tested.
    pub games: Vec<GameRecord>,
    /// The budget.
    pub budget: ScoreBudget,
    /// The clock.
    pub clock: ClockKind,
}

/// A set of mutants.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetRecord {
    /// Random seed of the set.
    pub seed: u64,
    /// Hash of the set.
    pub hash: String,
}

/// A game, and its testers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GameRecord {
    /// Name of the game.
    pub name: String,
    /// Version of its rules.
    pub version: u32,
    /// The testers.
    pub testers: Vec<ContestantRecord>,
    /// The detectors, each with its settings.
    pub detectors: Vec<String>,
    /// Names of the detectors that the game itself adds.
    #[serde(default)]
    pub own_detectors: Vec<String>,
}

/// The budget of each tester on each subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScoreBudget {
    /// Episodes of a tester that plays.
    pub episodes: u32,
    /// Environment steps of an explorer.
    pub steps: u64,
    /// Paths of an explorer that are replayed.
    pub routes: u32,
    /// Replays to minimise a finding; 0 for no minimisation.
    pub replays: u32,
    /// Random seed.
    pub seed: u64,
}

impl Default for ScoreBudget {
    fn default() -> Self {
        Self { episodes: 5, steps: 50_000, routes: 8, replays: 100, seed: 0 }
    }
}

impl ScoreRecord {
    /// Returns the differences between two scores, each in words.
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

    /// Returns the differences in settings. Scores of other games and sets can still be joined.
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

/// A level of a game, unmutated or with a planted defect.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Subject {
    /// Its unique name: that of the mutant, or game and level, such as `GAME MODE:7`.
    pub id: String,
    /// Name of the game.
    pub game: String,
    /// Its kind.
    #[serde(flatten)]
    pub kind: SubjectKind,
}

/// The kind of a subject.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum SubjectKind {
    /// A subject with a planted defect.
    Mutant {
        /// Class of the defect.
        class: String,
        /// Name of the subject that it was made of.
        original: String,
    },
    /// An unmutated level: every finding in it is false.
    Sound,
    /// An unmutated level that mutants were made of, and that is not among those that are counted.
    Original,
}

impl Subject {
    /// Returns the class of its defect, if it has one.
    pub fn class(&self) -> Option<&str> {
        match &self.kind {
            SubjectKind::Mutant { class, .. } => Some(class),
            SubjectKind::Sound | SubjectKind::Original => None,
        }
    }

    /// Returns the name of an unmutated level.
    pub fn id_of_level(game: &str, mode: &str, level: u64) -> String {
        format!("{game} {mode}:{level}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::testing::record;

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

    #[test]
    fn files_say_what_it_is() {
        let kind = SubjectKind::Mutant { class: "panic".to_owned(), original: "garden bed:3".to_owned() };
        let subject = Subject { id: "garden-panic-01".to_owned(), game: "garden".to_owned(), kind };
        let text = serde_json::to_string(&subject).expect("serialises");
        let expected =
            r#"{"id":"garden-panic-01","game":"garden","kind":"mutant","class":"panic","original":"garden bed:3"}"#;
        assert_eq!(text, expected);
        assert_eq!(serde_json::from_str::<Subject>(&text).expect("reads back"), subject);
        assert_eq!(subject.class(), Some("panic"));
    }
}
