//! Requests of a takeover.

use std::{fmt, path::PathBuf, str::FromStr};

use bevy::prelude::*;
use thiserror::Error;

use crate::unknown_name::nearest;

/// The request of a takeover; in text `record:FILE`, `policy:FILE` or `replay:FILE`.
#[derive(Clone, Debug, PartialEq, Eq, Reflect)]
pub enum TakeoverRequest {
    /// Record every episode of the agents that play, into this file.
    Record(PathBuf),
    /// Let this policy play.
    Policy(PathBuf),
    /// Let this recording play, one episode after the other.
    Replay(PathBuf),
}

/// The text is not a valid request.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum RequestError {
    /// The verb does not exist.
    #[error(
        "`{text}` is not a valid request{}; valid: record:FILE, policy:FILE, replay:FILE",
        .near.as_ref().map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"))
    )]
    Unknown {
        /// The text.
        text: String,
        /// The nearest verb.
        near: Option<String>,
    },
    /// The file is missing.
    #[error("`{way}:` names no file; write {way}:FILE")]
    NoFile {
        /// The verb.
        way: &'static str,
    },
}

const WAYS: [&str; 3] = ["record", "policy", "replay"];

impl FromStr for TakeoverRequest {
    type Err = RequestError;

    fn from_str(text: &str) -> Result<Self, RequestError> {
        let (name, file) = text.split_once(':').unwrap_or((text, ""));
        let Some(way) = WAYS.into_iter().find(|way| *way == name) else {
            let near = nearest(name, &WAYS).map(str::to_owned);
            return Err(RequestError::Unknown { text: text.to_owned(), near });
        };
        if file.is_empty() {
            return Err(RequestError::NoFile { way });
        }
        Ok(match way {
            "record" => Self::Record(file.into()),
            "policy" => Self::Policy(file.into()),
            _ => Self::Replay(file.into()),
        })
    }
}

impl fmt::Display for TakeoverRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Record(file) => write!(f, "record:{}", file.display()),
            Self::Policy(file) => write!(f, "policy:{}", file.display()),
            Self::Replay(file) => write!(f, "replay:{}", file.display()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_read_back_and_files_may_have_colons() {
        for text in ["record:a.demo", "policy:b/c.policy", "replay:C:\\d.demo"] {
            assert_eq!(text.parse::<TakeoverRequest>().expect("valid").to_string(), text);
        }
    }

    #[test]
    fn what_cannot_be_done_is_told_what_can() {
        for (text, words) in [
            ("polic:x", "did you mean `policy`?"),
            ("x", "valid: record:FILE, policy:FILE, replay:FILE"),
            ("", "valid: record:FILE"),
            ("record", "`record:` names no file"),
            ("replay:", "`replay:` names no file; write replay:FILE"),
        ] {
            let error = text.parse::<TakeoverRequest>().expect_err(text).to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
