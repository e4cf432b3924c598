//! Errors about unknown names, with the nearest valid name.
//!
//! ```
//! use bevy_playbot::unknown_name::UnknownName;
//!
//! let error = UnknownName::new("mode", "hrad", &["easy", "hard"]);
//! assert_eq!(error.to_string(), "unknown mode `hrad` (did you mean `hard`?); valid: easy, hard");
//! ```

use playbot_learner::HasExitCode;
use thiserror::Error;

/// The error of a name that does not exist.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("unknown {what} `{name}`{}; {}", question(.near.as_deref()), choice(.valid))]
pub struct UnknownName {
    /// The kind of name: `game`, `mode`, `bot`.
    pub what: &'static str,
    /// The name that was given.
    pub name: String,
    /// The valid name nearest to it.
    pub near: Option<String>,
    /// All valid names.
    pub valid: Vec<String>,
}

impl HasExitCode for UnknownName {}

/// Returns the question for the names that were probably meant, to stand behind an unknown one; nothing without such a
/// name.
///
/// ```
/// use bevy_playbot::unknown_name::{nearest, question};
///
/// assert_eq!(question(nearest("hrad", &["easy", "hard"])), " (did you mean `hard`?)");
/// assert_eq!(question(["one", "two"]), " (did you mean `one` or `two`?)");
/// assert_eq!(question(None), "");
/// ```
pub fn question<'a>(meant: impl IntoIterator<Item = &'a str>) -> String {
    let meant: Vec<String> = meant.into_iter().map(|name| format!("`{name}`")).collect();
    if meant.is_empty() { String::new() } else { format!(" (did you mean {}?)", meant.join(" or ")) }
}

fn choice(valid: &[String]) -> String {
    if valid.is_empty() { "there is none here".to_owned() } else { format!("valid: {}", valid.join(", ")) }
}

impl UnknownName {
    /// Returns the error for `name`, which is not among `valid`.
    pub fn new(what: &'static str, name: &str, valid: &[&str]) -> Self {
        Self {
            what,
            name: name.to_owned(),
            near: nearest(name, valid).map(str::to_owned),
            valid: valid.iter().map(|name| (*name).to_owned()).collect(),
        }
    }
}

/// Longest name, in bytes, that is compared with others. Longer names are no typing errors, and
/// comparing them is slow.
const LONGEST: usize = 256;

/// Least Jaro-Winkler similarity of a name to one that was probably meant. A letter too many, too few, wrong or swapped
/// leaves more than this in names of three letters and more. Words that share a few letters by chance have less.
const SIMILAR: f64 = 0.8;

/// Returns the candidate nearest to `name`, if one is similar at all.
pub fn nearest<'a>(name: &str, candidates: &[&'a str]) -> Option<&'a str> {
    if let Some(same) = candidates.iter().find(|candidate| candidate.eq_ignore_ascii_case(name)) {
        return Some(same);
    }
    if name.len() > LONGEST {
        return None;
    }
    candidates
        .iter()
        .map(|candidate| (strsim::jaro_winkler(name, candidate), *candidate))
        .filter(|(likeness, _)| *likeness > SIMILAR)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_typing_error_is_near_and_another_word_is_not() {
        let rooms = ["Pantry", "Stairs", "Larder", "Well", "Room_39"];
        for (wrong, near) in [
            ("Pantyr", "Pantry"),
            ("Stiars", "Stairs"),
            ("Ladder", "Larder"),
            ("Wall", "Well"),
            ("room_39", "Room_39"),
            ("WELL", "Well"),
        ] {
            assert_eq!(nearest(wrong, &rooms), Some(near), "{wrong}");
        }
        // `Sellar` has three letters of `Well`, and no more than chance leaves.
        for other in ["Sellar", "Attic", "300..200", "", "Pantry Stairs Larder Well".repeat(11).as_str()] {
            assert_eq!(nearest(other, &rooms), None, "{other}");
        }
    }
}
