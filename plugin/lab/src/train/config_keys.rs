//! Experiments as lists of keys with their values as text. Files, presets and `--set` override one another key by key.
//! Types are checked once, when the result is parsed; errors then lead back to the position of the value.

use std::{collections::BTreeMap, fmt, path::Path, sync::LazyLock};

use ron::{Options, error::SpannedError, extensions::Extensions, value::RawValue};
use serde::{
    Deserialize, Deserializer,
    de::{Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor},
};

use super::{
    config::Experiment,
    config_error::{ConfigError, Origin},
    known_settings::{self as known, is_section, missing_key, renamed, syntax_message, type_message, unknown_key},
};

/// A value as text.
#[derive(Clone, Debug)]
pub(super) struct Value {
    pub text: String,
    pub origin: Origin,
}

/// Values by the full path of their key, such as `ppo.lr`.
#[derive(Clone, Debug, Default)]
pub(super) struct Keys(BTreeMap<String, Value>);

/// Largest number of keys in a section, or outside all sections. A text with more is refused, since reading it would
/// take long.
const MOST_KEYS: usize = 200;

/// All keys, each with a valid value.
static ALL: LazyLock<Keys> = LazyLock::new(|| {
    let origin = Origin::start_of(Path::new("example"));
    let value = |text| Value { text, origin: origin.clone() };
    Keys(known::all().map(|setting| (setting.path.to_owned(), value(setting.sample()))).collect())
});

/// Returns a reader for which a value may stand for `Some(value)`.
fn reader() -> Options {
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME)
}

/// Checks that a text is one value of RON, of any type.
pub(super) fn check_syntax(text: &str) -> Result<(), SpannedError> {
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
    pub(super) fn all() -> &'static Self {
        &ALL
    }

    /// Returns the keys of a RON text. Required keys may be missing, and unknown ones are taken too.
    ///
    /// # Errors
    ///
    /// The text is not RON, no struct, or has a key twice.
    pub(super) fn of_text(text: &str, path: &Path) -> Result<Self, ConfigError> {
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
    pub(super) fn of_set(section: &str, text: &str, origin: &Origin) -> Result<Self, ConfigError> {
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
    pub(super) fn of_experiment(experiment: &Experiment, origin: &Origin) -> Result<Self, ConfigError> {
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
    pub(super) fn check_names(&self) -> Result<(), ConfigError> {
        match self.0.iter().find(|(key, _)| known::find(key).is_none()) {
            Some((key, value)) => Err(value.origin.key_error(unknown_key(key))),
            None => Ok(()),
        }
    }

    /// Returns the text of a value.
    pub(super) fn text(&self, key: &str) -> Option<&str> {
        self.0.get(key).map(|value| value.text.as_str())
    }

    /// Returns file, line and column of a key, or of the first one in a section; `None` if no file has it.
    pub(super) fn place(&self, key: &str) -> Option<(&Path, (usize, usize))> {
        let section = format!("{key}.");
        let found = self.0.iter().find(|(name, _)| *name == key || name.starts_with(&section))?;
        match &found.1.origin {
            Origin::File { path, key, .. } => Some((path, *key)),
            Origin::Set(_) => None,
        }
    }

    /// Takes a value out.
    pub(super) fn take(&mut self, key: &str) -> Option<Value> {
        self.0.remove(key)
    }

    /// Puts a value in.
    pub(super) fn put(&mut self, key: String, value: Value) {
        let key = match renamed(&key) {
            Some(name) => name.to_owned(),
            None => key,
        };
        self.0.insert(key, value);
    }

    /// Overrides these values by those of `later`.
    pub(super) fn overlaid(mut self, later: &Self) -> Self {
        self.0.extend(later.0.iter().map(|(key, value)| (key.clone(), value.clone())));
        self
    }

    /// Parses the experiment; missing keys get their defaults. Errors of no single value name `whole`.
    ///
    /// # Errors
    ///
    /// A value has the wrong type, or a key is missing.
    pub(super) fn parse(&self, whole: &Origin) -> Result<Experiment, ConfigError> {
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
    pub(super) fn valid_names(key: &str) -> Option<&'static [&'static str]> {
        let mut wrong = Self::all().clone();
        let origin = Origin::Set(String::new());
        wrong.put(key.to_owned(), Value { text: "no_such_name".to_owned(), origin });
        match reader().from_str::<Experiment>(&wrong.join().0) {
            Err(SpannedError { code: ron::Error::NoSuchEnumVariant { expected, .. }, .. }) => Some(expected),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
