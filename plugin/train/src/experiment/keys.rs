//! Experiments as lists of keys with their values as text. Files, presets and `--set` override one another key by key.
//! Types are checked once, when the result is parsed; errors then lead back to the position of the value.

use crate::experiment::{
    Experiment,
    error::{ConfigError, Origin},
};
use bevy_playbot::unknown_name::nearest;
use playbot_learner::settings::{Reader, Setting, Settings};
use ron::{Options, error::SpannedError, extensions::Extensions, value::RawValue};
use serde::{
    Deserialize, Deserializer,
    de::{Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor},
};
use std::{collections::BTreeMap, fmt, fmt::Write as _, path::Path, sync::LazyLock};

/// A value as text.
#[derive(Clone, Debug)]
pub(crate) struct Value {
    pub text: String,
    pub origin: Origin,
}

/// Values by the full path of their key, such as `ppo.lr`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Keys(BTreeMap<String, Value>);

/// Largest number of keys in a section, or outside all sections. A text with more is refused, since reading it would
/// take long.
const MOST_KEYS: usize = 200;

/// All keys, each with a valid value.
static ALL: LazyLock<Keys> = LazyLock::new(|| {
    let origin = Origin::start_of(Path::new("example"));
    let value = |text| Value { text, origin: origin.clone() };
    Keys(all().map(|setting| (setting.path.to_owned(), value(setting.sample()))).collect())
});

/// Returns a reader for which a value may stand for `Some(value)`.
fn reader() -> Options {
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME)
}

/// Checks that a text is one value of RON, of any type.
pub(crate) fn check_syntax(text: &str) -> Result<(), SpannedError> {
    reader().from_str::<IgnoredAny>(text).map(|_| ())
}

/// The fields of a RON struct, with or without a name before it: each key with its value, as they are written.
struct Fields<'a>(Vec<(&'a str, &'a str)>);

impl<'de> Deserialize<'de> for Fields<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(FieldsVisitor)
    }
}

struct FieldsVisitor;

impl<'de> Visitor<'de> for FieldsVisitor {
    type Value = Fields<'de>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a struct")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Fields<'de>, A::Error> {
        let mut fields = Vec::new();
        while let Some(key) = map.next_key()? {
            let value: &'de RawValue = map.next_value()?;
            fields.push((key, value.trim().get_ron()));
        }
        Ok(Fields(fields))
    }

    /// Takes `( )`, a struct without fields.
    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Fields<'de>, A::Error> {
        match seq.next_element::<IgnoredAny>()? {
            None => Ok(Fields(Vec::new())),
            Some(_) => Err(A::Error::custom("values without keys")),
        }
    }

    /// Takes `()`, and a name alone, which is no struct.
    fn visit_unit<E>(self) -> Result<Fields<'de>, E> {
        Ok(Fields(Vec::new()))
    }
}

/// Returns the fields of a struct; `None` if the text is something else.
fn fields(text: &str) -> Option<Vec<(&str, &str)>> {
    let is_map = text.trim_start().starts_with('{');
    let Fields(fields) = reader().from_str(text).ok().filter(|_| !is_map)?;
    (!fields.is_empty() || text.contains('(')).then_some(fields)
}

/// Returns the byte of a text at which a part of it begins.
fn offset(text: &str, part: &str) -> usize {
    part.as_ptr().addr().saturating_sub(text.as_ptr().addr()).min(text.len())
}

/// Returns line and column, both from 1, of a byte.
fn position(text: &str, at: usize) -> (usize, usize) {
    let before = text.get(..at).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (line_feeds(before) + 1, before[line_start..].chars().count() + 1)
}

/// Counts line feeds, fast enough for a file of a million of them.
fn line_feeds(text: &str) -> usize {
    text.bytes().filter(|byte| *byte == b'\n').count()
}

impl Keys {
    /// Returns all keys, each with a valid value.
    pub(crate) fn all() -> &'static Self {
        &ALL
    }

    /// Returns the keys of a RON text. Required keys may be missing, and unknown ones are taken too.
    ///
    /// # Errors
    ///
    /// The text is not RON, no struct, or has a key twice.
    pub(crate) fn of_text(text: &str, path: &Path) -> Result<Self, ConfigError> {
        let start = Origin::start_of(path);
        if text.trim().is_empty() {
            return Err(start.key_error("the file is empty: write an experiment into it, (key: value, ...)".to_owned()));
        }
        check_syntax(text).map_err(|error| {
            let at = (error.span.end.line, error.span.end.col);
            start.error(at, syntax_message(&error.code))
        })?;
        let mut keys = Self::default();
        let at = |part: &str| position(text, offset(text, part));
        keys.collect(text, "", &|key, value| Origin::File { path: path.into(), key: at(key), value: at(value) })?;
        Ok(keys)
    }

    /// Returns the keys of one section, from the text `(key: value, ...)` of a `key=value`.
    ///
    /// # Errors
    ///
    /// The text is not RON or has a key twice.
    pub(crate) fn of_set(section: &str, text: &str, origin: &Origin) -> Result<Self, ConfigError> {
        check_syntax(text).map_err(|error| origin.error((1, 1), syntax_message(&error.code)))?;
        let mut keys = Self::default();
        keys.collect(text, &format!("{section}."), &|_, _| origin.clone())?;
        Ok(keys)
    }

    /// Returns every key of an experiment; errors in a value name `origin`.
    ///
    /// # Errors
    ///
    /// The path of its demonstrations is not Unicode.
    pub(crate) fn of_experiment(experiment: &Experiment, origin: &Origin) -> Result<Self, ConfigError> {
        let text = experiment.to_ron().map_err(|error| origin.error((1, 1), error.to_string()))?;
        let mut keys = Self::default();
        keys.collect(&text, "", &|_, _| origin.clone())?;
        Ok(keys)
    }

    /// Adds the fields of a struct, and those of the sections in it. `origin` says where a key and its value were
    /// written.
    fn collect(&mut self, text: &str, prefix: &str, origin: &dyn Fn(&str, &str) -> Origin) -> Result<(), ConfigError> {
        let Some(fields) = fields(text) else {
            let message = "an experiment is a list of keys in round brackets: (key: value, ...)";
            return Err(origin(text, text).key_error(message.to_owned()));
        };
        if fields.len() > MOST_KEYS {
            let message =
                format!("{} keys in one place: no part of an experiment has as many as {MOST_KEYS}", fields.len());
            return Err(origin(text, text).key_error(message));
        }
        for (index, (name, value)) in fields.iter().enumerate() {
            let key = format!("{prefix}{name}");
            let origin_here = origin(name, value);
            if fields[..index].iter().any(|(before, _)| before == name) {
                return Err(origin_here.key_error(format!("`{key}` is there twice")));
            }
            if is_section(&key) && self::fields(value).is_some() {
                self.collect(value, &format!("{key}."), origin)?;
            } else {
                self.put(key, Value { text: (*value).to_owned(), origin: origin_here });
            }
        }
        Ok(())
    }

    /// Refuses keys that do not exist.
    ///
    /// # Errors
    ///
    /// The unknown key with the nearest one that exists.
    pub(crate) fn check_names(&self) -> Result<(), ConfigError> {
        match self.0.iter().find(|(key, _)| find(key).is_none()) {
            Some((key, value)) => Err(value.origin.key_error(unknown_key(key))),
            None => Ok(()),
        }
    }

    /// Returns the text of a value.
    pub(crate) fn text(&self, key: &str) -> Option<&str> {
        self.0.get(key).map(|value| value.text.as_str())
    }

    /// Returns file, line and column of a key, or of the first one in a section; `None` if no file has it.
    pub(crate) fn place(&self, key: &str) -> Option<(&Path, (usize, usize))> {
        let section = format!("{key}.");
        let found = self.0.iter().find(|(name, _)| *name == key || name.starts_with(&section))?;
        match &found.1.origin {
            Origin::File { path, key, .. } => Some((path, *key)),
            Origin::Set(_) => None,
        }
    }

    /// Takes a value out.
    pub(crate) fn take(&mut self, key: &str) -> Option<Value> {
        self.0.remove(key)
    }

    /// Puts a value in.
    pub(crate) fn put(&mut self, key: String, value: Value) {
        let key = match renamed(&key) {
            Some(name) => name.to_owned(),
            None => key,
        };
        self.0.insert(key, value);
    }

    /// Overrides these values by those of `later`.
    pub(crate) fn overlaid(mut self, later: &Self) -> Self {
        self.0.extend(later.0.iter().map(|(key, value)| (key.clone(), value.clone())));
        self
    }

    /// Parses the experiment; missing keys get their defaults. Errors of no single value name `whole`.
    ///
    /// # Errors
    ///
    /// A value has the wrong type, or a key is missing.
    pub(crate) fn parse(&self, whole: &Origin) -> Result<Experiment, ConfigError> {
        let (text, lines) = self.join();
        reader().from_str(&text).map_err(|error| self.explain(&error, &lines, whole))
    }

    /// Joins the values to one RON text. Every value begins on a line of its own, which is returned with its key.
    fn join(&self) -> (String, Vec<(usize, &str)>) {
        let (mut text, mut lines, mut open) = (String::from("("), Vec::new(), Vec::new());
        let mut line = 1;
        for (path, value) in &self.0 {
            let mut sections: Vec<&str> = path.split('.').collect();
            let key = sections.pop().unwrap_or_default();
            let shared = open.iter().zip(&sections).take_while(|(a, b)| a == b).count();
            text.push_str(&"),".repeat(open.len() - shared));
            text.extend(sections[shared..].iter().map(|section| format!("{section}:(")));
            open = sections;
            lines.push((line + 1, path.as_str()));
            text.push_str(&format!("{key}:\n{}\n,", value.text));
            line += 2 + line_feeds(&value.text);
        }
        text.push_str(&")".repeat(open.len() + 1));
        (text, lines)
    }

    fn explain(&self, error: &SpannedError, lines: &[(usize, &str)], whole: &Origin) -> ConfigError {
        if let ron::Error::MissingStructField { field, outer: Some(outer) } = &error.code
            && outer == "Experiment"
        {
            return whole.error((1, 1), missing_key(field));
        }
        let of = |at: ron::error::Position| lines.iter().rposition(|(line, _)| *line <= at.line);
        // The reader gives a span. Of a value that it refused at once, only the end lies in the value.
        let ron::error::Span { start, end } = error.span;
        let at = if of(start) == of(end) { start } else { end };
        let Some((key, line)) = of(end).map(|index| (lines[index].1, lines[index].0)) else {
            return whole.error((1, 1), error.code.to_string());
        };
        let value = &self.0[key];
        let message = type_message(&error.code, key, &value.text, || Self::valid_names(key));
        let within = (1..=value.text.lines().count()).contains(&(at.line + 1 - line));
        value.origin.error(if within { (at.line + 1 - line, at.col) } else { (1, 1) }, message)
    }

    /// Returns the names that this key takes, if it takes names: those that the reader lists when it gets another.
    pub(crate) fn valid_names(key: &str) -> Option<&'static [&'static str]> {
        let mut wrong = Self::all().clone();
        let origin = Origin::Set(String::new());
        wrong.put(key.to_owned(), Value { text: "no_such_name".to_owned(), origin });
        match reader().from_str::<Experiment>(&wrong.join().0) {
            Err(SpannedError { code: ron::Error::NoSuchEnumVariant { expected, .. }, .. }) => Some(expected),
            _ => None,
        }
    }
}

// Keys of an experiment, and messages about unknown keys and wrong values.

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
    if let Some(elsewhere) = elsewhere().find(of_near_section).or_else(|| elsewhere().next()) {
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

// The reference page of all settings.

/// Returns the reference page of all settings as Markdown: key, type, default, range, readers and documentation of
/// each.
pub fn settings_page() -> String {
    let mut page = String::from(
        "# Settings\n\nAll settings of an experiment. An experiment file is a RON struct, `(key: value, ...)`, in which a \
         section is a struct of its own: `ppo: (lr: 0.0003)`. `--set ppo.lr=0.0003` changes one setting. `playbot config \
         show` prints an experiment with all its values; settings that are off by default are left out.\n\n\
         \"Read by\" names the algorithms that a setting changes. A setting without a default must be given.\n",
    );
    let outside = Experiment::SETTINGS.iter().filter(|setting| setting.section.is_none());
    section(&mut page, "The experiment", "Settings outside all sections.", outside);
    for setting in Experiment::SETTINGS {
        if let Some(inner) = setting.section {
            section(&mut page, &format!("`{}`", setting.path), &summary(setting.doc), inner.iter());
        }
    }
    page
}

fn section<'a>(page: &mut String, title: &str, about: &str, settings: impl Iterator<Item = &'a Setting> + Clone) {
    let common = most_common(settings.clone().map(|setting| setting.readers));
    let _ = write!(
        page,
        "\n## {title}\n\n{about} Read by {}, if the table names no others.\n\n| key | type | default | range | read by | |\n\
         | --- | --- | --- | --- | --- | --- |\n",
        reader_names(common)
    );
    for setting in settings {
        let default = setting.default.map(|default| format!("`{}`", default())).unwrap_or_default();
        let cells = [
            format!("`{}`", setting.path),
            type_in_words(setting),
            default,
            setting.range.to_string(),
            if setting.readers == common { String::new() } else { reader_names(setting.readers) },
            summary(setting.doc),
        ];
        let _ = writeln!(page, "| {} |", cells.map(|cell| cell.replace('|', "\\|")).join(" | "));
    }
}

/// The readers that most settings of a section have; of several, those of the first.
fn most_common(all: impl Iterator<Item = &'static [Reader]> + Clone) -> &'static [Reader] {
    let count = |readers: &&[Reader]| all.clone().filter(|other| other == readers).count();
    let most = all.clone().map(|readers| count(&readers)).max();
    all.clone().find(|readers| Some(count(readers)) == most).unwrap_or_default()
}

/// The type of a setting in words.
fn type_in_words(setting: &Setting) -> String {
    let name = setting.type_name;
    if let Some(inner) = name.strip_prefix("Option<").and_then(|name| name.strip_suffix('>')) {
        return format!("{} or `None`", plain_kind(inner));
    }
    match Keys::valid_names(setting.path) {
        Some(names) => names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "),
        None => plain_kind(name).to_owned(),
    }
}

fn plain_kind(type_name: &str) -> &'static str {
    match type_name {
        "bool" => "true or false",
        "f64" => "number",
        "(f64, f64)" => "two numbers",
        "u32" | "u64" | "usize" => "whole number",
        "Vec<u64>" | "Vec<usize>" => "list of whole numbers",
        name if name.starts_with("Vec<") => "list",
        _ => "text",
    }
}

fn reader_names(readers: &[Reader]) -> String {
    if readers.is_empty() {
        return "all algorithms".to_owned();
    }
    let words = readers.iter().map(|Reader { algorithm, switch }| match switch {
        Some(switch) => format!("{algorithm} with `{switch}`"),
        None => (*algorithm).to_owned(),
    });
    words.collect::<Vec<_>>().join(", ")
}

/// The first paragraph of a documentation, on one line and without the targets of its links.
fn summary(doc: &str) -> String {
    let lines = doc.lines().map(str::trim).skip_while(|line| line.is_empty()).take_while(|line| !line.is_empty());
    let text = lines.collect::<Vec<_>>().join(" ");
    let mut parts = text.split("[`");
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        match part.split_once("`](").and_then(|(name, rest)| Some((name, rest.split_once(')')?.1))) {
            Some((name, rest)) => plain += &format!("`{name}`{rest}"),
            None => plain += &format!("[`{part}"),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Algorithm;

    #[test]
    fn values_of_every_kind_come_out_as_written() {
        let text = r##"// a comment, with ( and "
        Experiment( /* and /* another ) */ one */ a: 1, b : -0.5e-3 , c: "x, ) \" y", d: r#"raw " )"#,
            e: [1, (2, 3)], f: /* before */ Some(Relu), g: ')', h: { "k": (z: 1) }, i: (x: 1, y: (w: 2)), // last )
            j: Named(x: "//"), k: '"',
        )"##;
        let expected = [
            ("a", "1"),
            ("b", "-0.5e-3"),
            ("c", r#""x, ) \" y""#),
            ("d", r##"r#"raw " )"#"##),
            ("e", "[1, (2, 3)]"),
            ("f", "Some(Relu)"),
            ("g", "')'"),
            ("h", r#"{ "k": (z: 1) }"#),
            ("i", "(x: 1, y: (w: 2))"),
            ("j", r#"Named(x: "//")"#),
            ("k", "'\"'"),
        ];
        assert_eq!(fields(text), Some(expected.to_vec()));
        assert_eq!(fields("()"), Some(Vec::new()));
        assert_eq!(fields("( )"), Some(Vec::new()));
        let extended = "#![enable(implicit_some)]\n#![enable(unwrap_newtypes)] // on\n(a: 1)";
        assert_eq!(fields(extended), Some(vec![("a", "1")]));
    }

    #[test]
    fn a_text_without_keys_is_no_struct() {
        for text in ["3", "[1]", "[]", "(1, 2)", "\"a: 1\"", "Relu", "Some(3)", "{\"a\": 1}", ""] {
            assert_eq!(fields(text), None, "{text}");
        }
    }

    #[test]
    fn positions_count_from_one_in_characters() {
        let text = "(\n  ä: 1,\n  b: 2)";
        let fields = fields(text).expect("a struct");
        let at = |part: &str| position(text, offset(text, part));
        assert_eq!(at(fields[0].1), (2, 6));
        assert_eq!(at(fields[1].0), (3, 3));
    }

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

    #[test]
    fn rows_say_type_default_range_and_readers() {
        let page = settings_page();
        for row in [
            "| `ppo.lr` | number | `0.0005` | above 0, at most 1e30 |  | Learning rate of Adam. |",
            "Read by score-ppo, ppo, spirl-ppo, spirl-sac with `spirl.learn_decoder`, if the table names no others.",
            "| `sac.critics` | whole number | `2` | at least 1 | score-sac, sac, spirl-sac |",
            "| `seeds` | list of whole numbers | `[]` |  |  |",
            "| `score.alpha` | `Auto`, `Off`,",
            "| `skills.patience` | whole number or `None` | `None` | at least 1 |",
            "| `game` | text |  |  |  | Name of the game. |",
        ] {
            assert!(page.contains(row), "{row}\n{page}");
        }
        assert_eq!(summary(" One [`A`](super::A) and\n two `b`.\n\n Three."), "One `A` and two `b`.");
    }
}
