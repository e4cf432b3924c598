//! The levels that a run has seen.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Largest number of ranges that are printed.
const NAMED: usize = 4;

/// Levels that a policy or model has learned from, by play or from demonstrations, for people and for checks. Results
/// on them say nothing about unseen ones.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub struct SeenLevels {
    /// Name of the game.
    pub game: String,
    /// The levels, as ranges with both ends, such as `hard:0..63`.
    pub levels: Vec<String>,
    /// Hashes of the level files among them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub level_files: Vec<u64>,
    /// Hashes of the layouts of these files.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layouts: Vec<u64>,
}

impl SeenLevels {
    /// Adds those of `other` that are missing.
    pub fn extend(&mut self, other: &Self) {
        let levels = other.levels.iter().filter(|range| !self.levels.contains(range));
        self.levels.extend(levels.cloned().collect::<Vec<_>>());
        let files = other.level_files.iter().filter(|hash| !self.level_files.contains(hash));
        self.level_files.extend(files.copied().collect::<Vec<_>>());
        let layouts = other.layouts.iter().filter(|hash| !self.layouts.contains(hash));
        self.layouts.extend(layouts.copied().collect::<Vec<_>>());
    }
}

impl fmt::Display for SeenLevels {
    /// Writes its levels: `hard:0..63, easy:5..5 and 2 level files`.
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
    fn they_are_said_in_few_words() {
        let seen = |levels: usize, files: u64| {
            let levels = (0..levels).map(|i| format!("hard:{i}..{i}")).collect();
            SeenLevels { game: "a".to_owned(), levels, level_files: (0..files).collect(), layouts: Vec::new() }
                .to_string()
        };
        assert_eq!(seen(1, 0), "hard:0..0");
        assert_eq!(seen(2, 1), "hard:0..0, hard:1..1 and 1 level file");
        assert_eq!(seen(0, 2), "2 level files");
        assert!(seen(9, 0).ends_with("hard:3..3 and 5 more ranges of levels"), "{}", seen(9, 0));
        assert_eq!(seen(0, 0), "no levels");
    }
}
