//! What is wrong with the text of a level.

use serde::de::DeserializeOwned;

use super::json_lines::{JsonStep, line_of};

/// A text is no level of the game.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelTextError {
    /// Line of the text, from 1; `None` if it is about none in particular.
    pub line: Option<usize>,
    /// What is wrong, and what would be right.
    pub what: String,
}

impl LevelTextError {
    /// Something that is wrong with the whole text.
    pub fn whole(what: impl Into<String>) -> Self {
        Self { line: None, what: what.into() }
    }

    /// Something that is wrong with a value of a JSON text, or with what it stands in if it is not there.
    pub fn at(text: &str, path: &[JsonStep], what: impl Into<String>) -> Self {
        Self { line: Some(line_of(text, path)), what: what.into() }
    }
}

/// Reads a JSON text that is an object.
///
/// # Errors
///
/// It is none, or not of this form: [`LevelTextError`] with the line.
pub fn read_json<T: DeserializeOwned>(text: &str) -> Result<T, LevelTextError> {
    // Some editors put a mark in front of all they write.
    let text = text.trim_start_matches('\u{feff}');
    // A struct would be read from a list of its fields, too.
    let blank = text.len() - text.trim_start().len();
    if text[blank..].starts_with('[') {
        let line = 1 + text[..blank].matches('\n').count();
        let what = "a level is an object, `{…}`, and this is a list".to_owned();
        return Err(LevelTextError { line: Some(line), what });
    }
    serde_json::from_str(text).map_err(|error| {
        let (line, column) = (error.line().max(1), error.column());
        let words = error.to_string();
        let place = format!(" at line {} column {column}", error.line());
        let what = format!("{} (column {column})", words.strip_suffix(&place).unwrap_or(&words));
        LevelTextError { line: Some(line), what }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mistakes_of_syntax_and_unknown_keys_have_a_line() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Small {
            #[allow(dead_code, reason = "only read")]
            x: u32,
        }
        let error = |text: &str| read_json::<Small>(text).expect_err("wrong");
        assert_eq!(error("{\n \"x\": 1,\n \"y\": 2\n}").line, Some(3));
        assert!(error("{\n \"x\": 1,\n \"y\": 2\n}").what.starts_with("unknown field `y`, expected `x` (column"));
        assert_eq!(error("{\n \"x\": \n}").line, Some(3));
        assert_eq!(error("").line, Some(1));
        let list = error("\n [3]");
        assert!(list.line == Some(2) && list.what.contains("this is a list"), "{list:?}");
        assert_eq!(read_json::<Small>("\u{feff}{\"x\": 3}").expect("a mark is no mistake").x, 3);
    }
}
