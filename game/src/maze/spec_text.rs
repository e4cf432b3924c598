//! Generated mazes as options of a mode: `size=9x9+loops=0.2`.

use std::{ops::RangeInclusive, str::FromStr};

use thiserror::Error;

use super::spec::MazeSpec;

/// The value of an option cannot be read.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("`{key}={value}`: {wanted}")]
pub struct OptionError {
    /// The option.
    pub key: String,
    /// The given value.
    pub value: String,
    /// The expected form.
    pub wanted: &'static str,
}

impl OptionError {
    /// Takes an option with the expected form.
    pub fn new(key: &str, value: &str, wanted: &'static str) -> Self {
        Self { key: key.to_owned(), value: value.to_owned(), wanted }
    }
}

impl MazeSpec {
    /// Options of a mode with generated mazes, each with a value it takes.
    pub const OPTIONS: [&'static str; 4] = ["size=9x9", "loops=0.2", "corridor=2", "difficulty=10..20"];

    /// Takes one option; false if it is none of a maze's.
    ///
    /// # Errors
    ///
    /// The value cannot be read. Its meaning is [`check`](Self::check)ed apart.
    pub fn set_option(&mut self, key: &str, value: &str) -> Result<bool, OptionError> {
        let wrong = |wanted| OptionError::new(key, value, wanted);
        match key {
            "size" => {
                (self.rows, self.columns) =
                    pair(value, "x").ok_or_else(|| wrong("write rows x columns, as in size=9x9"))?
            }
            "loops" => {
                self.loops = value.parse().map_err(|_| wrong("write a share between 0 and 1, as in loops=0.2"))?
            }
            "corridor" => self.corridor = value.parse().map_err(|_| wrong("write cells, as in corridor=2"))?,
            "difficulty" => {
                let read =
                    range(value).ok_or_else(|| wrong("write moves, as in difficulty=12 or difficulty=10..20"))?;
                self.difficulty = Some(read);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Returns the options that differ from the default, as [`set_option`](Self::set_option) takes them: `key=value`.
    pub fn options(&self) -> Vec<String> {
        let usual = Self::default();
        let mut options = Vec::new();
        if (self.rows, self.columns) != (usual.rows, usual.columns) {
            options.push(format!("size={}x{}", self.rows, self.columns));
        }
        if self.loops != usual.loops {
            options.push(format!("loops={}", self.loops));
        }
        if self.corridor != usual.corridor {
            options.push(format!("corridor={}", self.corridor));
        }
        if let Some(wanted) = &self.difficulty {
            options.push(format!("difficulty={}..{}", wanted.start(), wanted.end()));
        }
        options
    }
}

fn pair<T: FromStr>(text: &str, between: &str) -> Option<(T, T)> {
    let (left, right) = text.split_once(between)?;
    Some((left.parse().ok()?, right.parse().ok()?))
}

/// Parses `10..20`, both ends included, or one number.
fn range(text: &str) -> Option<RangeInclusive<usize>> {
    if let Ok(one) = text.parse() {
        return Some(one..=one);
    }
    pair(text, "..").map(|(least, most)| least..=most)
}
