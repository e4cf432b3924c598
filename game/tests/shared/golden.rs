//! Reference numbers, measured on the original games.
//!
//! They lie in `tests/fixtures`, or all in one folder that the environment variable `PLAYBOT_GOLDEN_GAMES` names.
//! Another set may have other levels, runs and counts under the same names.

use std::path::Path;

use serde::de::DeserializeOwned;

/// Returns the text of a file, by its path below `tests/fixtures`.
pub fn text(fixture: &str) -> String {
    let path = match std::env::var_os("PLAYBOT_GOLDEN_GAMES") {
        Some(folder) => Path::new(&folder).join(Path::new(fixture).file_name().expect("the path of a file")),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(fixture),
    };
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Parses a JSON file.
pub fn json<T: DeserializeOwned>(fixture: &str) -> T {
    serde_json::from_str(&text(fixture)).unwrap_or_else(|error| panic!("{fixture}: {error}"))
}
