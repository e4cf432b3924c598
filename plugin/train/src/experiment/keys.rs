//! The keys of an experiment: the setting of each, and messages about unknown keys and wrong values.

use crate::experiment::Experiment;
use bevy_playbot::unknown_name::nearest;
use playbot_learner::settings::{Setting, Settings};
use std::{collections::BTreeMap, sync::LazyLock};

/// Settings that are no sections, by their path.
static ALL_SETTINGS: LazyLock<BTreeMap<&'static str, &'static Setting>> = LazyLock::new(|| {
    fn gather(settings: &'static [Setting], all: &mut BTreeMap<&'static str, &'static Setting>) {
        for setting in settings {
            match setting.section {
                Some(inner) => gather(inner, all),
                None => _ = all.insert(setting.path, setting),
            }
        }
    }
    let mut all = BTreeMap::new();
    gather(Experiment::SETTINGS, &mut all);
    all
});

/// Returns the setting with this path.
pub(crate) fn find(path: &str) -> Option<&'static Setting> {
    ALL_SETTINGS.get(path).copied()
}

/// Iterates over all settings that are no sections, in the order of their paths.
pub(crate) fn all() -> impl Iterator<Item = &'static Setting> {
    ALL_SETTINGS.values().copied()
}

/// Returns whether there are keys below this one.
pub(crate) fn is_section(key: &str) -> bool {
    all().any(|setting| setting.path.strip_prefix(key).is_some_and(|rest| rest.starts_with('.')))
}

/// Returns the path that the setting of an older file has now.
pub(crate) fn renamed(key: &str) -> Option<&'static str> {
    all().find(|setting| setting.former_path().is_some_and(|former| former == key)).map(|setting| setting.path)
}

fn paths() -> impl Iterator<Item = &'static str> {
    ALL_SETTINGS.keys().copied()
}

/// Returns the message about an unknown key: it names the nearest key, or else all keys of the section.
pub(crate) fn unknown_key(key: &str) -> String {
    if is_section(key) {
        return format!("`{key}` is a section: write {key}: (key: value); its keys: {}", list(key));
    }
    let (section, name) = key.rsplit_once('.').unwrap_or(("", key));
    match neighbour(section, name) {
        Some(near) => format!("unknown key `{key}`; did you mean `{near}`?"),
        None if section.is_empty() => format!("unknown key `{key}`; valid keys: {}", list("")),
        None if is_section(section) => {
            format!("unknown key `{key}`; valid keys in `{section}`: {}", list(section))
        }
        None if find(section).is_some() => format!("unknown key `{key}`: `{section}` has no keys"),
        None => format!("unknown key `{key}`; valid sections and keys: {}", list("")),
    }
}

/// Returns the key nearest to `name`: the same name elsewhere, else a similar one in this section, else one in a
/// section with a similar name.
fn neighbour(section: &str, name: &str) -> Option<String> {
    let join = |section: &str, name: &str| if section.is_empty() { name.into() } else { format!("{section}.{name}") };
    let near_section = nearest(section, &names(""));
    let same_name = |path: &&str| path.rsplit('.').next() == Some(name);
    // Of several, the one in a section with a similar name.
    let of_near_section = |path: &&str| near_section.is_some_and(|near| **path == join(near, name));
    let elsewhere = || paths().filter(same_name);
    // In a section with several rates, `lr` means `actor_lr` rather than the `lr` of another section.
    let longer =
        |path: &&str| path.strip_prefix(&format!("{section}.")).is_some_and(|own| own.ends_with(&format!("_{name}")));
    if let Some(longer) = paths().find(longer) {
        return Some(longer.to_owned());
    }
    // Else the first of those whose section has most letters of the wrong one.
    let letters = |path: &str| {
        let own = path.split('.').next().unwrap_or_default();
        section.chars().filter(|letter| own.contains(*letter)).count()
    };
    let likeliest = || elsewhere().reduce(|one, other| if letters(other) > letters(one) { other } else { one });
    if let Some(elsewhere) = elsewhere().find(of_near_section).or_else(likeliest) {
        return Some(elsewhere.to_owned());
    }
    let mut here = names(section);
    // `base` is read before the keys, and so is not among them.
    here.extend(section.is_empty().then_some("base"));
    if let Some(near) = nearest(name, &here) {
        return Some(join(section, near));
    }
    let near = near_section?;
    Some(join(near, nearest(name, &names(near))?))
}

/// Returns the names of keys and sections directly in a section; "" is the experiment itself.
fn names(section: &str) -> Vec<&'static str> {
    let prefix = if section.is_empty() { String::new() } else { format!("{section}.") };
    let inside = paths().filter_map(|path| path.strip_prefix(&prefix));
    let mut names: Vec<&str> = inside.map(|rest| rest.split('.').next().unwrap_or(rest)).collect();
    names.dedup();
    names
}

fn list(section: &str) -> String {
    names(section).join(", ")
}

/// Returns the message about a value of the wrong type. `valid_names` are the names that the key takes.
pub(crate) fn type_message(
    error: &ron::Error,
    key: &str,
    text: &str,
    valid_names: impl Fn() -> Option<&'static [&'static str]>,
) -> String {
    match error {
        // A type that reads itself, such as a range of levels, has the best message.
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
                format!("`{key}` must be {}, not {text}{why}", kind(key))
            }
        },
    }
}

/// Returns the message about a text that is no value.
pub(crate) fn no_value(key: &str, text: &str, error: &ron::Error) -> String {
    let wanted = kind(key);
    if text.is_empty() {
        return format!("`{key}` must be {wanted}; there is nothing behind the =");
    }
    format!("`{key}` must be {wanted}; `{text}` is not a value: {}", syntax_message(error))
}

/// Returns the message about a text that is not RON.
pub(crate) fn syntax_message(error: &ron::Error) -> String {
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
        Fault::ExpectedAttribute => {
            "there is no experiment behind this #: an experiment is in round brackets, as `playbot config show` prints one"
        }
        Fault::ExceededRecursionLimit => "too many brackets are open at once: an experiment needs a few levels of them",
        Fault::UnclosedBlockComment => "a comment has no end: a */ is missing",
        other => return other.to_string(),
    };
    words.to_owned()
}

/// Returns the message about a missing key.
pub(crate) fn missing_key(key: &str) -> String {
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

/// Returns the kind of value that a key takes, in words.
fn kind(key: &str) -> String {
    let example = find(key).map(Setting::sample).unwrap_or_default();
    match example.chars().next() {
        Some('"') => "text in quotes".to_owned(),
        Some('[') if example.len() > "[]".len() => format!("a list in square brackets such as {example}"),
        Some('[') => "a list in square brackets".to_owned(),
        Some('{') => format!("values by their keys in curly brackets such as {example}"),
        Some('(') => format!("values in round brackets such as {example}"),
        Some('0'..='9' | '-') if example.contains(['.', 'e']) => format!("a number such as {example}"),
        Some('0'..='9') => format!("a whole number such as {example}"),
        _ if matches!(example.as_str(), "true" | "false") => "true or false".to_owned(),
        _ if example == "None" => "None or Some(value)".to_owned(),
        _ if example.contains('(') => format!("something such as {example}"),
        _ => format!("a name such as {example}"),
    }
}

/// Returns the identifier at the beginning of a text; empty if there is none.
fn word(text: &str) -> &str {
    let end = text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len());
    &text[..end]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Algorithm;

    #[test]
    fn rows_lie_in_their_sections_and_name_algorithms_and_switches_that_exist() {
        for section in Experiment::SETTINGS {
            for setting in section.section.unwrap_or_default() {
                assert_eq!(setting.path, format!("{}.{}", section.path, setting.name()));
                for reader in setting.readers {
                    assert!(reader.algorithm.parse::<Algorithm>().is_ok(), "{}: {reader:?}", setting.path);
                    assert!(
                        reader.switch.is_none_or(|switch| find(switch).is_some_and(|found| found.type_name == "bool")),
                        "{}: {reader:?}",
                        setting.path
                    );
                }
            }
        }
        assert_eq!(renamed("sac.alpha_lr"), Some("sac.temperature_lr"));
    }
}
