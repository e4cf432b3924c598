//! What demonstrations say about themselves to people.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Most ranges that are named where a card is said.
const NAMED: usize = 4;

/// Where the demonstrations come from that skills are learned from, for people and for checks: a policy that plays these skills has
/// seen their levels.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub struct DemoCard {
    /// Name of the game.
    pub game: String,
    /// The levels that they show, as ranges with both ends, such as `hard:0..63`.
    pub levels: Vec<String>,
    /// Hashes of the level files that they show.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub level_files: Vec<u64>,
}

impl fmt::Display for DemoCard {
    /// Its levels: `hard:0..63, easy:5..5 and 2 level files`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts: Vec<String> = self.levels.iter().take(NAMED).cloned().collect();
        let (more, files) = (self.levels.len().saturating_sub(NAMED), self.level_files.len());
        if more > 0 {
            parts.push(format!("{more} more ranges of levels"));
        }
        if files > 0 {
            parts.push(format!("{files} level file{}", if files == 1 { "" } else { "s" }));
        }
        match parts.split_last() {
            Some((last, rest)) if !rest.is_empty() => write!(f, "{} and {last}", rest.join(", ")),
            Some((only, _)) => f.write_str(only),
            None => f.write_str("no levels"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_card_is_said_in_few_words() {
        let card = |levels: usize, files: u64| {
            let levels = (0..levels).map(|i| format!("hard:{i}..{i}")).collect();
            DemoCard { game: "a".to_owned(), levels, level_files: (0..files).collect() }.to_string()
        };
        assert_eq!(card(1, 0), "hard:0..0");
        assert_eq!(card(2, 1), "hard:0..0, hard:1..1 and 1 level file");
        assert_eq!(card(0, 2), "2 level files");
        assert!(card(9, 0).ends_with("hard:3..3 and 5 more ranges of levels"), "{}", card(9, 0));
        assert_eq!(card(0, 0), "no levels");
    }
}
