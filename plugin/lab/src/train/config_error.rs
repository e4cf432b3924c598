//! What is wrong with an experiment, in words that say where and what to do.

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

use super::{config::ExperimentError, config_keys::Keys, ron_keys::word};
use crate::brief::brief;
use bevy_playbot::unknown_name::nearest;

/// An experiment cannot be used. What the words quote of it is cut short where it is very long.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}{}", path.display(), way_out(path, source))]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The text is not an experiment.
    #[error("{}:{line}:{column}: {}", path.display(), brief(message))]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What is wrong, and the nearest valid key where a key is unknown.
        message: String,
    },
    /// A text `key=value` does not fit.
    #[error("`{}`: {}", brief(set), brief(message))]
    Set {
        /// The text.
        set: String,
        /// What is wrong with it.
        message: String,
    },
    /// What `key=value` changes does not go with the rest, which was sound before.
    #[error("{}", brief(&of_sets(sets, source)))]
    Sets {
        /// The texts, those that are to blame if it can be told.
        sets: Vec<String>,
        /// Why.
        source: Box<ExperimentError>,
    },
    /// The values do not go together.
    #[error("{}:{}:{}: {}", path.display(), at.0, at.1, brief(&source.to_string()))]
    Values {
        /// The file.
        path: PathBuf,
        /// Line and column of the key to blame, from 1; the first ones of the file if it leaves that key out.
        at: (usize, usize),
        /// Why.
        source: Box<ExperimentError>,
    },
}

/// What to do about a file that is not there.
fn way_out(path: &Path, error: &io::Error) -> String {
    if error.kind() != io::ErrorKind::NotFound {
        return String::new();
    }
    format!("; name an experiment file that exists, or begin one with `playbot config show > {}`", path.display())
}

/// The texts `key=value` and what is wrong with them; a key that is set and refused is named once.
fn of_sets(sets: &[String], error: &ExperimentError) -> String {
    let shown = sets.join("`, `");
    match (sets, error) {
        ([set], ExperimentError::Value { key, value, why }) if *set == format!("{key}={value}") => {
            format!("`{shown}`: {why}")
        }
        _ => format!("`{shown}`: {error}"),
    }
}

/// What to say about a key that does not exist: the nearest one, in its own section or anywhere; otherwise all keys of
/// its section.
pub(super) fn unknown_key(key: &str) -> String {
    if Keys::all().is_section(key) {
        return format!("`{key}` is a section: write {key}: (key: value); its keys: {}", list(key));
    }
    let (section, name) = key.rsplit_once('.').unwrap_or(("", key));
    match neighbour(section, name) {
        Some(near) => format!("unknown key `{key}`; did you mean `{near}`?"),
        None if section.is_empty() => format!("unknown key `{key}`; valid keys: {}", list("")),
        None if Keys::all().is_section(section) => {
            format!("unknown key `{key}`; valid keys in `{section}`: {}", list(section))
        }
        None if Keys::all().text(section).is_some() => format!("unknown key `{key}`: `{section}` has no keys"),
        None => format!("unknown key `{key}`; valid sections and keys: {}", list("")),
    }
}

/// The key nearest to `name`: the same name elsewhere, otherwise one like it in this section, otherwise one in a section
/// whose name is near.
fn neighbour(section: &str, name: &str) -> Option<String> {
    let join = |section: &str, name: &str| if section.is_empty() { name.into() } else { format!("{section}.{name}") };
    let near_section = nearest(section, &names(""));
    let same_name = |path: &&str| path.rsplit('.').next() == Some(name);
    // Of several, the one whose section looks like this one.
    let of_near_section = |path: &&str| near_section.is_some_and(|near| **path == join(near, name));
    let elsewhere = || Keys::all().paths().filter(same_name);
    // `lr` of a section that has several is `actor_lr` there, rather than that of another one.
    let longer =
        |path: &&str| path.strip_prefix(&format!("{section}.")).is_some_and(|own| own.ends_with(&format!("_{name}")));
    if let Some(longer) = Keys::all().paths().find(longer) {
        return Some(longer.to_owned());
    }
    if let Some(elsewhere) = elsewhere().find(of_near_section).or_else(|| elsewhere().next()) {
        return Some(elsewhere.to_owned());
    }
    let mut here = names(section);
    // Read before the keys are, and so none of them.
    here.extend(section.is_empty().then_some("base"));
    if let Some(near) = nearest(name, &here) {
        return Some(join(section, near));
    }
    let near = near_section?;
    Some(join(near, nearest(name, &names(near))?))
}

/// Names of keys and sections directly in a section; "" is the experiment itself.
fn names(section: &str) -> Vec<&'static str> {
    let prefix = if section.is_empty() { String::new() } else { format!("{section}.") };
    let inside = Keys::all().paths().filter_map(|path| path.strip_prefix(&prefix));
    let mut names: Vec<&str> = inside.map(|rest| rest.split('.').next().unwrap_or(rest)).collect();
    names.dedup();
    names
}

fn list(section: &str) -> String {
    names(section).join(", ")
}

/// What to say about a value that the reader refused. `valid_names` are the names of which the key takes one.
pub(super) fn type_message(
    error: &ron::Error,
    key: &str,
    text: &str,
    valid_names: impl Fn() -> Option<&'static [&'static str]>,
) -> String {
    match error {
        // A type with its own reading, such as a range of levels, says best what it wants.
        ron::Error::Message(message) => format!("`{key}`: {message}"),
        ron::Error::NoSuchStructField { expected, found, .. } => match nearest(found, expected) {
            Some(near) => format!("unknown key `{found}` in `{key}`; did you mean `{near}`?"),
            None => format!("unknown key `{found}` in `{key}`; valid keys: {}", expected.join(", ")),
        },
        ron::Error::MissingStructField { field, .. } => format!("`{field}` is missing in `{key}`"),
        ron::Error::NoSuchEnumVariant { expected, found, .. } => one_of(key, found, expected),
        other => match valid_names() {
            Some(names) if !names.contains(&word(text)) => one_of(key, text, names),
            _ => {
                let why = if matches!(other, ron::Error::IntegerOutOfBounds) { ": it is out of range" } else { "" };
                format!("`{key}` must be {}, not {text}{why}", kind(Keys::all().text(key)))
            }
        },
    }
}

/// What to say about a text that is no value at all.
pub(super) fn no_value(key: &str, text: &str, error: &ron::Error) -> String {
    let wanted = kind(Keys::all().text(key));
    if text.is_empty() {
        return format!("`{key}` must be {wanted}; there is nothing behind the =");
    }
    format!("`{key}` must be {wanted}; `{text}` is not a value: {}", syntax_message(error))
}

/// What to say about a text that is not RON.
pub(super) fn syntax_message(error: &ron::Error) -> String {
    use ron::Error as Fault;
    let words = match error {
        Fault::Eof => "the text ends too early: a value or a closing bracket is missing",
        Fault::ExpectedStringEnd => "a text in quotes has no end: a \" is missing",
        Fault::ExpectedArrayEnd
        | Fault::ExpectedComma
        | Fault::ExpectedMapEnd
        | Fault::ExpectedOptionEnd
        | Fault::ExpectedStructLikeEnd => "a comma or a closing bracket is missing",
        Fault::ExpectedMapColon => "a colon is missing between a key and its value",
        Fault::TrailingCharacters => "the text goes on behind its end: a bracket or a comma is wrong",
        Fault::UnclosedBlockComment => "a comment has no end: a */ is missing",
        other => return other.to_string(),
    };
    words.to_owned()
}

/// What to say about a key that every experiment needs.
pub(super) fn missing_key(key: &str) -> String {
    let example = match key {
        "game" => "the name of the game",
        "train" => "levels to train on, such as train: \"MODE:0..63\"",
        "test" => "held-out levels, such as test: \"MODE:64..127\"",
        "steps" => "how long to train, such as steps: 1000000",
        _ => return format!("`{key}` is missing"),
    };
    format!("`{key}` is missing: {example}")
}

fn one_of(key: &str, found: &str, names: &[&str]) -> String {
    let hint = nearest(found, names).map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"));
    format!("`{key}` cannot be `{found}`{hint}; valid: {}", names.join(", "))
}

/// A value that may have been written over several lines.
fn one_line(value: &str) -> String {
    let lines: Vec<_> = value.lines().map(str::trim).collect();
    [("[ ", "["), (", ]", "]"), ("( ", "("), (", )", ")")]
        .iter()
        .fold(lines.join(" "), |text, (from, to)| text.replace(from, to))
}

/// The kind of value that an example is, in words.
fn kind(example: Option<&str>) -> String {
    let example = one_line(example.unwrap_or_default());
    match example.chars().next() {
        Some('"') => "text in quotes".to_owned(),
        Some('[') if example.len() > "[]".len() => format!("a list in square brackets such as {example}"),
        Some('[') => "a list in square brackets".to_owned(),
        Some('(') => format!("values in round brackets such as {example}"),
        Some('0'..='9' | '-') if example.contains(['.', 'e']) => format!("a number such as {example}"),
        Some('0'..='9') => format!("a whole number such as {example}"),
        _ if matches!(example.as_str(), "true" | "false") => "true or false".to_owned(),
        _ if example == "None" => "None or Some(value)".to_owned(),
        _ if example.contains('(') => format!("something such as {example}"),
        _ => format!("a name such as {example}"),
    }
}
