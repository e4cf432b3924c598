//! Proofs about levels, found without play.

use serde::{Deserialize, Serialize};

/// Proof about the goal of a level: whether it can be reached.
///
/// A search that gave up proves nothing and gives [`Unknown`](Self::Unknown).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LevelProof {
    /// A path to the goal exists. It may take longer than an episode.
    Solvable,
    /// The goal cannot be reached by any sequence of actions.
    Unsolvable {
        /// Description of the exhausted search.
        why: String,
    },
    /// Nothing is proved.
    #[default]
    Unknown,
}

impl LevelProof {
    /// Returns the reason why the goal cannot be reached, if that is proved.
    pub fn why_unsolvable(&self) -> Option<&str> {
        match self {
            Self::Unsolvable { why } => Some(why),
            Self::Solvable | Self::Unknown => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_say_it_in_small_letters() {
        let text = |proof: &LevelProof| serde_json::to_string(proof).expect("serialises");
        assert_eq!(text(&LevelProof::Unknown), r#""unknown""#);
        let walled = LevelProof::Unsolvable { why: "walled in".to_owned() };
        assert_eq!(text(&walled), r#"{"unsolvable":{"why":"walled in"}}"#);
        assert_eq!(serde_json::from_str::<LevelProof>(&text(&walled)).expect("reads back"), walled);
        assert_eq!((walled.why_unsolvable(), LevelProof::Solvable.why_unsolvable()), (Some("walled in"), None));
    }
}
