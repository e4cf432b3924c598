//! Errors of level files and of file patterns.

use thiserror::Error;

use super::text_error::LevelTextError;

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
        /// What is wrong with it.
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
        /// What is wrong with it.
        error: LevelTextError,
    },
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::level_files::json_lines::JsonStep;

    #[test]
    fn what_is_wrong_with_a_file_is_told_with_its_line() {
        let told = |error| LevelFileError::Text { path: "a.json".to_owned(), error }.to_string();
        let text = "{\n  \"rows\": [\n    \"##\",\n    \"#?\"\n  ]\n}";
        let row = LevelTextError::at(text, &[JsonStep::Key("rows"), JsonStep::Index(1)], "unknown letter `?`");
        assert_eq!(told(row), "a.json, line 4: unknown letter `?`");
        assert_eq!(told(LevelTextError::whole("no levels here")), "a.json: no levels here");
    }

    #[test]
    fn of_several_broken_files_a_few_are_named() {
        let told = |count: usize| {
            let error = LevelTextError::whole("no levels here");
            let first = Box::new(LevelFileError::Text { path: "a.json".to_owned(), error });
            let others = (0..count).map(|number| format!("b{number}.json")).collect();
            LevelFileError::Several { first, others }.to_string()
        };
        assert_eq!(told(2), "a.json: no levels here; and 2 more: b0.json, b1.json");
        assert!(told(7).ends_with("; and 7 more: b0.json, b1.json, b2.json, b3.json, b4.json, …"), "{}", told(7));
        let none = |count| LevelFileError::NoLevel { mode: "files:*".to_owned(), level: 7, count }.to_string();
        assert!(none(1).contains("it has 1 file, level 0;") && none(3).contains("it has 3 files, so levels 0 to 2;"));
    }
}
