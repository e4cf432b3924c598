//! The subjects of a score: mutants and unmutated levels.

use serde::{Deserialize, Serialize};

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
