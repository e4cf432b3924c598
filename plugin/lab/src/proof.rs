//! What a game knows for certain of a level, without anybody playing it.

use serde::{Deserialize, Serialize};

/// Whether the aim of a level can be reached.
///
/// A search that gave up has proved nothing: that is [`Unknown`](Self::Unknown).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LevelProof {
    /// There is a way to the aim. Whether the time is enough for it is not said.
    Solvable,
    /// No sequence of actions whatever reaches the aim.
    Unsolvable {
        /// What was searched to its end, for people.
        why: String,
    },
    /// Nothing is proved.
    #[default]
    Unknown,
}

impl LevelProof {
    /// Why the aim cannot be reached, if that is proved.
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
