//! The recorded episodes that were replayed when an error occurred.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    path::PathBuf,
};

/// Recorded episodes that were replayed at the same time. Its text names their files: one of the episodes caused the
/// error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Replayed(BTreeMap<PathBuf, BTreeSet<usize>>);

impl Replayed {
    /// Creates it from the episodes, each with its file and its index there, from 0.
    pub fn new(episodes: impl IntoIterator<Item = (PathBuf, usize)>) -> Self {
        let mut by_file: BTreeMap<PathBuf, BTreeSet<usize>> = BTreeMap::new();
        for (file, index) in episodes {
            by_file.entry(file).or_default().insert(index);
        }
        Self(by_file)
    }
}

impl fmt::Display for Replayed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all: usize = self.0.values().map(BTreeSet::len).sum();
        f.write_str(if all > 1 { "one of " } else { "" })?;
        for (at, (file, episodes)) in self.0.iter().enumerate() {
            let and = if at == 0 { "" } else { " and " };
            let what = if episodes.len() == 1 { "episode" } else { "episodes" };
            let numbers: Vec<String> = episodes.iter().map(usize::to_string).collect();
            write!(f, "{and}{}, {what} {}", file.display(), numbers.join(", "))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn episodes_are_named_by_their_files() {
        let named = |episodes: &[(&str, usize)]| {
            Replayed::new(episodes.iter().map(|(file, index)| (PathBuf::from(file), *index))).to_string()
        };
        assert_eq!(named(&[("a.demo", 3)]), "a.demo, episode 3");
        assert_eq!(
            named(&[("b.demo", 2), ("a.demo", 10), ("a.demo", 9)]),
            "one of a.demo, episodes 9, 10 and b.demo, episode 2"
        );
    }
}
