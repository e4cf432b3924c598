//! Errors in the text of a level.

use serde::de::DeserializeOwned;

use super::json_lines::{JsonStep, line_of};

/// Invalid text of a level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelTextError {
    /// Line of the text, from 1; `None` for the whole text.
    pub line: Option<usize>,
    /// The error, with the form that would be valid.
    pub what: String,
}

impl LevelTextError {
    /// Makes an error of the whole text.
    pub fn whole(what: impl Into<String>) -> Self {
        Self { line: None, what: what.into() }
    }

    /// Makes an error at a value of a JSON text, or at the value that encloses it if it is missing.
    pub fn at(text: &str, path: &[JsonStep], what: impl Into<String>) -> Self {
        Self { line: Some(line_of(text, path)), what: what.into() }
    }
}

/// Reads a JSON text that is an object. Without this check, serde would also read a struct from a list of its fields.
///
/// # Errors
///
/// [`LevelTextError`] with the line if the text is not JSON or not of this form.
pub fn read_json_object<T: DeserializeOwned>(text: &str) -> Result<T, LevelTextError> {
    let text = without_mark(text);
    let blank = text.len() - text.trim_start().len();
    if text[blank..].starts_with('[') {
        let line = 1 + text[..blank].matches('\n').count();
        let what = "a level must be an object, `{…}`, and this is a list".to_owned();
        return Err(LevelTextError { line: Some(line), what });
    }
    read_json(text)
}

/// Strips the byte order mark that some editors write.
fn without_mark(text: &str) -> &str {
    text.trim_start_matches('\u{feff}')
}

/// Reads a JSON text.
///
/// # Errors
///
/// [`LevelTextError`] with the line if the text is not JSON or not of this form.
pub fn read_json<T: DeserializeOwned>(text: &str) -> Result<T, LevelTextError> {
    serde_json::from_str(without_mark(text)).map_err(|error| {
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
        let list = read_json_object::<Small>("\n [3]").expect_err("a list");
        assert!(list.line == Some(2) && list.what.contains("this is a list"), "{list:?}");
        assert_eq!(read_json_object::<Small>("\u{feff} {\"x\": 3}").expect("an object").x, 3);
        assert_eq!(read_json::<Small>("\u{feff}{\"x\": 3}").expect("a mark is no mistake").x, 3);
    }
}
