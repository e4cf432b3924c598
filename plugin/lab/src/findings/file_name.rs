//! Names of files of findings.

use bevy_playbot::state_hash::StateHash;

use super::stored::StoredFinding;

/// Ending of the files.
pub(super) const ENDING: &str = "finding";
/// Most letters of the descriptive part of a name.
const MOST_LETTERS: usize = 80;

impl StoredFinding {
    /// Returns the name of its file, such as `hard-7.panic.random-1f2e3d4c.finding`: level, detector, tester, and
    /// letters that make it unique. In a test, a minimised finding keeps its name.
    pub fn file_name(&self) -> String {
        let head = &self.head;
        let parts = [Some(&head.level), Some(&head.detector), head.tester.as_ref()];
        let parts: Vec<&str> = parts.into_iter().flatten().map(String::as_str).collect();
        let plain = |letter: char| if letter.is_ascii_alphanumeric() || "-_".contains(letter) { letter } else { '-' };
        let parts: Vec<String> = parts.iter().map(|part| part.chars().map(plain).collect()).collect();
        let text: String = parts.join(".").chars().take(MOST_LETTERS).collect();
        let game = [self.header.game.as_str(), &head.level, &head.detector, head.tester.as_deref().unwrap_or("")];
        let bytes = game.into_iter().chain([head.message.as_str()]).flat_map(|part| {
            // A value that is no byte ends each part.
            part.bytes().map(u64::from).chain([u64::from(u8::MAX) + 1])
        });
        let hash = StateHash::of(bytes.chain([head.seed])).folded();
        format!("{text}-{hash:08x}.{ENDING}")
    }
}

#[cfg(test)]
mod tests {
    use crate::findings::{FindingHead, StoredFinding, testing::stored};

    fn name(head: FindingHead) -> String {
        StoredFinding { head, ..stored() }.file_name()
    }

    #[test]
    fn a_name_says_what_it_is_and_tells_it_from_others() {
        let head = stored().head;
        let first = name(head.clone());
        assert!(first.starts_with("hard-7.panic.random-") && first.ends_with(".finding"), "{first}");
        assert_eq!(name(FindingHead { tick: Some(0), ..head.clone() }), first, "a shorter way is the same finding");
        let others = [
            FindingHead { level: "hard-7".to_owned(), ..head.clone() },
            FindingHead { seed: 6, ..head.clone() },
            FindingHead { message: "it freezes".to_owned(), ..head.clone() },
        ];
        assert!(others.into_iter().all(|other| name(other) != first));
        let long = name(FindingHead { level: "levels/deep/ö/".repeat(40), ..head });
        assert!(long.len() < 110 && long.starts_with("levels-deep--"), "{long}");
    }
}
