//! Errors of level files and of file patterns.

use serde::de::DeserializeOwned;
use thiserror::Error;

/// Failure to read levels from files.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum LevelFileError {
    /// Invalid pattern.
    #[error(
        "`files:{pattern}` is not a valid file pattern: {why} (character {at}); write * for any name, ** for any folders, \
         as in files:levels/**/*.json"
    )]
    Pattern {
        /// The pattern.
        pattern: String,
        /// Position of the wrong character in the pattern, from 1.
        at: usize,
        /// Description of the fault.
        why: String,
    },
    /// No file matches the pattern.
    #[error(
        "files:{pattern} matches no file (seen from {folder}): name level files, as in files:levels/**/*.json, quoted \
         against the shell"
    )]
    NoFiles {
        /// The pattern.
        pattern: String,
        /// Folder from which the pattern is read.
        folder: String,
    },
    /// The path is a folder.
    #[error("{path} is a folder: name the files in it, as in files:{path}/**/*.json")]
    Folder {
        /// The folder.
        path: String,
    },
    /// Too many files.
    #[error("files:{pattern} matches more than 16,777,216 files: name fewer")]
    TooMany {
        /// The pattern.
        pattern: String,
    },
    /// Fewer files than the requested level needs.
    #[error("there is no level {level} in {mode}: it has {}; leave out the numbers for all", files(*count))]
    NoLevel {
        /// The mode.
        mode: String,
        /// The level.
        level: u64,
        /// Number of files, at least 1.
        count: u64,
    },
    /// The operating system refused to read a file or folder.
    #[error("cannot read {path}: {why}; name an existing level file that you may read")]
    Unreadable {
        /// File or folder.
        path: String,
        /// The answer of the operating system.
        why: String,
    },
    /// Not a regular file.
    #[error("{path} is a folder, a pipe or a device, not a regular file: name a file with a level")]
    NotAFile {
        /// Its path.
        path: String,
    },
    /// The file is UTF-16, without the mark that says so.
    #[error("{path}: {utf16}")]
    Utf16 {
        /// The file.
        path: String,
        /// Its byte order.
        utf16: Utf16,
    },
    /// The file is not UTF-8 text.
    #[error("{path}, line {line}: byte {byte} of the line is not UTF-8: save the level as UTF-8, or name another file")]
    NoText {
        /// The file.
        path: String,
        /// Line, from 1.
        line: usize,
        /// Byte of the line, from 1.
        byte: usize,
    },
    /// The file is larger than any level.
    #[error("{path} has {bytes} bytes, and a level file has at most {most}: name another file")]
    TooLarge {
        /// The file.
        path: String,
        /// Its length.
        bytes: u64,
        /// Largest accepted size, bytes.
        most: u64,
    },
    /// Several files are not levels of the game.
    #[error("{first}; and {} more: {}", others.len(), listed(others))]
    Several {
        /// Error of the first file.
        first: Box<LevelFileError>,
        /// Paths of the other files.
        others: Vec<String>,
    },
    /// The file is not a level of the game.
    #[error("{path}{}: {}", line(error), error.what)]
    Text {
        /// The file.
        path: String,
        /// Description of the fault.
        error: LevelTextError,
    },
}

/// Text in UTF-16 without a byte order mark, and its byte order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "it is text in UTF-16 without a byte order mark: save it as UTF-8 in an editor, or with `iconv -f {0} -t UTF-8`"
)]
pub struct Utf16(&'static str);

impl Utf16 {
    /// Recognises UTF-16 by zeros, the high bytes of Latin letters. They are every other byte of at least half of the
    /// text, and at the same side of each pair.
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
        let (pairs, _) = bytes.as_chunks::<2>();
        let zeros = |side: usize| pairs.iter().filter(|pair| pair[side] == 0).count();
        let is_most = |count: usize| count > 0 && 2 * count >= pairs.len();
        match [zeros(0), zeros(1)] {
            [0, low] if is_most(low) => Some(Self("UTF-16LE")),
            [high, 0] if is_most(high) => Some(Self("UTF-16BE")),
            _ => None,
        }
    }
}

fn files(count: u64) -> String {
    if count == 1 { "1 file, level 0".to_owned() } else { format!("{count} files, so levels 0 to {}", count - 1) }
}

/// Lists the first few paths.
fn listed(paths: &[String]) -> String {
    const SHOWN: usize = 5;
    let shown = paths.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    if paths.len() > SHOWN { format!("{shown}, …") } else { shown }
}

fn line(error: &LevelTextError) -> String {
    error.line.map_or_else(String::new, |line| format!(", line {line}"))
}

// Errors in the text of a level.

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

// Line numbers in a JSON text.

/// A step from a value of a JSON text to one inside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JsonStep<'a> {
    /// To the value of a key.
    Key(&'a str),
    /// To an entry of a list, counted from 0.
    Index(usize),
}

/// Returns the line, from 1, on which a value of valid JSON begins. If the value is missing, returns the line of the
/// last value on the path to it.
pub(super) fn line_of(text: &str, path: &[JsonStep]) -> usize {
    let mut scanner = Scanner { bytes: text.trim_start_matches('\u{feff}').as_bytes(), at: 0 };
    scanner.skip_space();
    let mut found = scanner.at;
    for step in path {
        let entered = match *step {
            JsonStep::Key(key) => scanner.enter_key(key),
            JsonStep::Index(index) => scanner.enter_index(index),
        };
        if entered.is_none() {
            break;
        }
        found = scanner.at;
    }
    1 + scanner.bytes[..found].iter().filter(|&&byte| byte == b'\n').count()
}

/// Scanner of a JSON text.
struct Scanner<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Scanner<'a> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn take(&mut self, wanted: u8) -> Option<()> {
        (self.peek()? == wanted).then(|| self.at += 1)
    }

    fn skip_space(&mut self) {
        while self.peek().is_some_and(|byte| byte.is_ascii_whitespace()) {
            self.at += 1;
        }
    }

    /// Returns the text between quotation marks, escapes included.
    fn string(&mut self) -> Option<&'a [u8]> {
        self.take(b'"')?;
        let start = self.at;
        loop {
            match self.peek()? {
                b'"' => {
                    let string = &self.bytes[start..self.at];
                    self.at += 1;
                    return Some(string);
                }
                b'\\' => self.at += 2,
                _ => self.at += 1,
            }
        }
    }

    fn skip_value(&mut self) -> Option<()> {
        let mut depth = 0usize;
        loop {
            match self.peek()? {
                b'"' => {
                    self.string()?;
                }
                b'{' | b'[' => {
                    depth += 1;
                    self.at += 1;
                }
                b'}' | b']' => {
                    depth = depth.checked_sub(1)?;
                    self.at += 1;
                }
                _ => {
                    self.at += 1;
                    // Numbers and words end before these characters.
                    let goes_on = self.peek().is_some_and(|byte| !b",]}".contains(&byte));
                    if depth == 0 && goes_on {
                        continue;
                    }
                }
            }
            if depth == 0 {
                return Some(());
            }
        }
    }

    fn enter_key(&mut self, key: &str) -> Option<()> {
        self.take(b'{')?;
        loop {
            self.skip_space();
            let found = self.string()? == key.as_bytes();
            self.skip_space();
            self.take(b':')?;
            self.skip_space();
            if found {
                return Some(());
            }
            self.skip_value()?;
            self.skip_space();
            self.take(b',')?;
        }
    }

    fn enter_index(&mut self, index: usize) -> Option<()> {
        self.take(b'[')?;
        self.skip_space();
        for _ in 0..index {
            self.skip_value()?;
            self.skip_space();
            self.take(b',')?;
            self.skip_space();
        }
        // No entry follows the last one.
        (self.peek()? != b']').then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use JsonStep::{Index, Key};

    #[test]
    fn what_is_wrong_with_a_file_is_reported_with_its_line() {
        let reported = |error| LevelFileError::Text { path: "a.json".to_owned(), error }.to_string();
        let text = "{\n  \"rows\": [\n    \"##\",\n    \"#?\"\n  ]\n}";
        let row = LevelTextError::at(text, &[JsonStep::Key("rows"), JsonStep::Index(1)], "unknown letter `?`");
        assert_eq!(reported(row), "a.json, line 4: unknown letter `?`");
        assert_eq!(reported(LevelTextError::whole("no levels here")), "a.json: no levels here");
    }

    #[test]
    fn of_several_broken_files_a_few_are_named() {
        let reported = |count: usize| {
            let error = LevelTextError::whole("no levels here");
            let first = Box::new(LevelFileError::Text { path: "a.json".to_owned(), error });
            let others = (0..count).map(|number| format!("b{number}.json")).collect();
            LevelFileError::Several { first, others }.to_string()
        };
        assert_eq!(reported(2), "a.json: no levels here; and 2 more: b0.json, b1.json");
        assert!(
            reported(7).ends_with("; and 7 more: b0.json, b1.json, b2.json, b3.json, b4.json, …"),
            "{}",
            reported(7)
        );
        let none = |count| LevelFileError::NoLevel { mode: "files:*".to_owned(), level: 7, count }.to_string();
        assert!(none(1).contains("it has 1 file, level 0;") && none(3).contains("it has 3 files, so levels 0 to 2;"));
    }

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

    const TEXT: &str = r#"
{
  "a": [1, 2.5e3,
    "], \" }"],
  "b": { "c": true, "d":
    [ {}, [],
      -7
    ] },

  "rows": []
}"#;

    #[test]
    fn values_are_found_on_their_lines() {
        for (path, line) in [
            (&[][..], 2),
            (&[Key("a")], 3),
            (&[Key("a"), Index(1)], 3),
            (&[Key("a"), Index(2)], 4),
            (&[Key("b"), Key("c")], 5),
            (&[Key("b"), Key("d")], 6),
            (&[Key("b"), Key("d"), Index(1)], 6),
            (&[Key("b"), Key("d"), Index(2)], 7),
            (&[Key("rows")], 10),
            (&[Key("rows"), Index(0)], 10),
            (&[Key("missing")], 2),
            (&[Key("a"), Index(9)], 3),
        ] {
            assert_eq!(line_of(TEXT, path), line, "{path:?}");
        }
    }

    #[test]
    fn texts_that_are_no_json_lead_nowhere() {
        for text in ["", "{", "[", "{\"a\"", "{\"a\": \"", "[1, ", "nonsense"] {
            assert_eq!(line_of(text, &[Key("a"), Index(3)]), 1, "{text}");
        }
    }
}
