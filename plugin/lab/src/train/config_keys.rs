//! An experiment as a list of keys with their values as text, which is how files, presets and `--set` are laid over one
//! another: key by key, the later one wins. Types are looked at once, when the result is parsed; errors are then traced
//! back to where the value was written.

use std::{collections::BTreeMap, path::Path, sync::LazyLock};

use ron::{Options, error::SpannedError, extensions::Extensions};
use serde::de::IgnoredAny;

pub(super) use super::config_origin::Origin;
use super::{
    config::Experiment,
    config_error::{ConfigError, missing_key, syntax_message, type_message, unknown_key},
    ron_keys::{fields, line_feeds, position},
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

/// More keys than any section has, or the experiment outside its sections. Those of a text with more are not looked at, which
/// would take long.
const MOST_KEYS: usize = 200;

/// All keys there are, with an example of each value.
static ALL: LazyLock<Keys> = LazyLock::new(|| {
    // With keys that are not written as long as they do nothing.
    let least = r#"(game: "-", train: "-:0..0", test: "-:1..1", demos: "-", demo_wins: true, steps: 1, skills: (
        augment: [Translate(1)], weight_decay: 0.1, held_out: 0.1, patience: Some(1), state_weight: 1.0, anneal_lr: true),
        ppo: (augment: [Translate(1)]))"#;
    let example: Experiment = reader().from_str(least).expect("every required key is there");
    Keys::of_experiment(&example, &Origin::start_of(Path::new("example"))).expect("it was just read")
});

/// A value may stand for `Some(value)`.
fn reader() -> Options {
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME)
}

/// Whether a text is one value of RON, of whatever type.
pub(super) fn check_syntax(text: &str) -> Result<(), SpannedError> {
    reader().from_str::<IgnoredAny>(text).map(|_| ())
}

/// What a key of older files is called now.
pub(super) fn renamed(key: &str) -> Option<&'static str> {
    (key == "sac.alpha_lr").then_some("sac.temperature_lr")
}

impl Keys {
    /// All keys there are, with an example of each value.
    pub(super) fn all() -> &'static Self {
        &ALL
    }

    /// The keys of a RON text. They need not be complete; unknown ones are taken too.
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
        let origin =
            |key, value| Origin::File { path: path.into(), key: position(text, key), value: position(text, value) };
        keys.collect(text, 0, "", &origin, &|key, _| ALL.is_section(key))?;
        Ok(keys)
    }

    /// The keys of one section, from the text `(key: value, ...)` of a `key=value`.
    ///
    /// # Errors
    ///
    /// The text is not RON or has a key twice.
    pub(super) fn of_set(section: &str, text: &str, origin: &Origin) -> Result<Self, ConfigError> {
        check_syntax(text).map_err(|error| origin.error((1, 1), syntax_message(&error.code)))?;
        let mut keys = Self::default();
        keys.collect(text, 0, &format!("{section}."), &|_, _| origin.clone(), &|key, _| ALL.is_section(key))?;
        Ok(keys)
    }

    /// Every key of an experiment; errors in a value will be said to come from `origin`.
    ///
    /// # Errors
    ///
    /// The path of its demonstrations is not Unicode.
    pub(super) fn of_experiment(experiment: &Experiment, origin: &Origin) -> Result<Self, ConfigError> {
        let text = experiment.to_ron().map_err(|error| origin.error((1, 1), error.to_string()))?;
        let mut keys = Self::default();
        // This text is what tells sections from values: a section begins with its bracket, the variant of an enum with its
        // name.
        keys.collect(&text, 0, "", &|_, _| origin.clone(), &|_, value| value.starts_with('('))?;
        Ok(keys)
    }

    /// Adds the fields of the struct at byte `at`, and those of the sections in it.
    fn collect(
        &mut self,
        text: &str,
        at: usize,
        prefix: &str,
        origin: &dyn Fn(usize, usize) -> Origin,
        is_section: &dyn Fn(&str, &str) -> bool,
    ) -> Result<(), ConfigError> {
        let Some(fields) = fields(text, at) else {
            let message = "an experiment is a list of keys in round brackets: (key: value, ...)";
            return Err(origin(at, at).key_error(message.to_owned()));
        };
        if fields.len() > MOST_KEYS {
            let message =
                format!("{} keys in one place: no part of an experiment has as many as {MOST_KEYS}", fields.len());
            return Err(origin(at, at).key_error(message));
        }
        for (index, field) in fields.iter().enumerate() {
            let key = format!("{prefix}{}", field.key);
            let origin_here = origin(field.key_at, field.value_at);
            if fields[..index].iter().any(|before| before.key == field.key) {
                return Err(origin_here.key_error(format!("`{key}` is there twice")));
            }
            if is_section(&key, field.value) && self::fields(text, field.value_at).is_some() {
                self.collect(text, field.value_at, &format!("{key}."), origin, is_section)?;
            } else {
                self.put(key, Value { text: field.value.to_owned(), origin: origin_here });
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
        match self.0.iter().find(|(key, _)| !ALL.0.contains_key(*key)) {
            Some((key, value)) => Err(value.origin.key_error(unknown_key(key))),
            None => Ok(()),
        }
    }

    /// Whether there are keys below this one.
    pub(super) fn is_section(&self, key: &str) -> bool {
        let prefix = format!("{key}.");
        self.0.range(prefix.clone()..).next().is_some_and(|(key, _)| key.starts_with(&prefix))
    }

    /// The text of a value.
    pub(super) fn text(&self, key: &str) -> Option<&str> {
        self.0.get(key).map(|value| value.text.as_str())
    }

    /// Where a key, or the first one of a section, was written: file, line and column; `None` if no file says it.
    pub(super) fn place(&self, key: &str) -> Option<(&Path, (usize, usize))> {
        let section = format!("{key}.");
        let found = self.0.iter().find(|(name, _)| *name == key || name.starts_with(&section))?;
        match &found.1.origin {
            Origin::File { path, key, .. } => Some((path, *key)),
            Origin::Set(_) => None,
        }
    }

    /// Full paths of all keys, in alphabetical order.
    pub(super) fn paths(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
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

    /// These values, and those of `later` over them.
    pub(super) fn overlaid(mut self, later: &Self) -> Self {
        self.0.extend(later.0.iter().map(|(key, value)| (key.clone(), value.clone())));
        self
    }

    /// The experiment; what is left out gets its default. `whole` is where errors of no single value lie.
    ///
    /// # Errors
    ///
    /// A value has the wrong type, or a key is missing.
    pub(super) fn parse(&self, whole: &Origin) -> Result<Experiment, ConfigError> {
        let (text, lines) = self.join();
        reader().from_str(&text).map_err(|error| self.explain(&error, &lines, whole))
    }

    /// One RON text. Every value begins on a line of its own, which is returned with its key.
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
        // The reader says from where to where it was; of what it refused at once only the end lies in the value.
        let ron::error::Span { start, end } = error.span;
        let at = if of(start) == of(end) { start } else { end };
        let Some((key, line)) = of(end).map(|index| (lines[index].1, lines[index].0)) else {
            return whole.error((1, 1), error.code.to_string());
        };
        let value = &self.0[key];
        let message = type_message(&error.code, key, &value.text, || self.valid_names(key));
        let within = (1..=value.text.lines().count()).contains(&(at.line + 1 - line));
        value.origin.error(if within { (at.line + 1 - line, at.col) } else { (1, 1) }, message)
    }

    /// The names of which this key takes one, if it is of that kind: those that the reader says when it gets another.
    fn valid_names(&self, key: &str) -> Option<&'static [&'static str]> {
        let mut wrong = Self::all().clone();
        let origin = Origin::Set(String::new());
        wrong.put(key.to_owned(), Value { text: "no_such_name".to_owned(), origin });
        match reader().from_str::<Experiment>(&wrong.join().0) {
            Err(SpannedError { code: ron::Error::NoSuchEnumVariant { expected, .. }, .. }) => Some(expected),
            _ => None,
        }
    }
}
