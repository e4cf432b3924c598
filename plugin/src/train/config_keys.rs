//! An experiment as a list of keys with their values as text, which is how files, presets and `--set` are laid over one
//! another: key by key, the later one wins. Types are looked at once, when the result is parsed; errors are then traced
//! back to where the value was written.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::LazyLock,
};

use ron::{Options, error::SpannedError, extensions::Extensions};
use serde::de::IgnoredAny;

use super::{
    config::Experiment,
    config_error::{ConfigError, type_message, unknown_key},
    ron_keys::{fields, position},
};

/// Where a value was written.
#[derive(Clone, Debug)]
pub(super) enum Origin {
    /// In a file, at this line and column.
    File {
        /// The file.
        path: PathBuf,
        /// Line and column of the value.
        at: (usize, usize),
    },
    /// In a text `key=value`.
    Set(String),
}

impl Origin {
    pub(super) fn start_of(path: &Path) -> Self {
        Self::File { path: path.into(), at: (1, 1) }
    }

    /// An error at a line and column of the value, both from 1.
    pub(super) fn error(&self, (line, column): (usize, usize), message: String) -> ConfigError {
        match self {
            Self::File { path, at } => ConfigError::Syntax {
                path: path.clone(),
                line: at.0 + line - 1,
                column: if line == 1 { at.1 + column - 1 } else { column },
                message,
            },
            Self::Set(set) => ConfigError::Set { set: set.clone(), message },
        }
    }
}

/// A value as text.
#[derive(Clone, Debug)]
pub(super) struct Value {
    pub text: String,
    pub origin: Origin,
}

/// Values by the full path of their key, such as `ppo.lr`.
#[derive(Clone, Debug, Default)]
pub(super) struct Keys(BTreeMap<String, Value>);

/// All keys there are, with an example of each value.
static ALL: LazyLock<Keys> = LazyLock::new(|| {
    let least = r#"(game: "-", train: "-:0..0", test: "-:1..1", demos: "-", steps: 1)"#;
    let example: Experiment = ron::from_str(least).expect("every required key is there");
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
        check_syntax(text).map_err(|error| {
            let at = (error.span.start.line, error.span.start.col);
            start.error(at, error.code.to_string())
        })?;
        let mut keys = Self::default();
        let origin = |at| Origin::File { path: path.into(), at: position(text, at) };
        keys.collect(text, 0, "", &origin, &|key, _| ALL.is_section(key))?;
        Ok(keys)
    }

    /// The keys of one section, from the text `(key: value, ...)` of a `key=value`.
    ///
    /// # Errors
    ///
    /// The text is not RON or has a key twice.
    pub(super) fn of_set(section: &str, text: &str, origin: &Origin) -> Result<Self, ConfigError> {
        check_syntax(text).map_err(|error| origin.error((1, 1), error.code.to_string()))?;
        let mut keys = Self::default();
        keys.collect(text, 0, &format!("{section}."), &|_| origin.clone(), &|key, _| ALL.is_section(key))?;
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
        // Told by their looks, since it is an example that says what is a section; variants of enums have a name.
        keys.collect(&text, 0, "", &|_| origin.clone(), &|_, value| value.starts_with('('))?;
        Ok(keys)
    }

    /// Adds the fields of the struct at byte `at`, and those of the sections in it.
    fn collect(
        &mut self,
        text: &str,
        at: usize,
        prefix: &str,
        origin: &dyn Fn(usize) -> Origin,
        is_section: &dyn Fn(&str, &str) -> bool,
    ) -> Result<(), ConfigError> {
        let Some(fields) = fields(text, at) else {
            let message = "an experiment is a list of keys in round brackets: (key: value, ...)";
            return Err(origin(at).error((1, 1), message.to_owned()));
        };
        for (index, field) in fields.iter().enumerate() {
            let key = format!("{prefix}{}", field.key);
            if fields[..index].iter().any(|before| before.key == field.key) {
                return Err(origin(field.key_at).error((1, 1), format!("`{key}` is there twice")));
            }
            if is_section(&key, field.value) && self::fields(text, field.value_at).is_some() {
                self.collect(text, field.value_at, &format!("{key}."), origin, is_section)?;
            } else {
                self.put(key, Value { text: field.value.to_owned(), origin: origin(field.value_at) });
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
            Some((key, value)) => Err(value.origin.error((1, 1), unknown_key(key))),
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
        for (path, value) in &self.0 {
            let mut sections: Vec<&str> = path.split('.').collect();
            let key = sections.pop().unwrap_or_default();
            let shared = open.iter().zip(&sections).take_while(|(a, b)| a == b).count();
            text.push_str(&"),".repeat(open.len() - shared));
            text.extend(sections[shared..].iter().map(|section| format!("{section}:(")));
            open = sections;
            lines.push((text.matches('\n').count() + 2, path.as_str()));
            text.push_str(&format!("{key}:\n{}\n,", value.text));
        }
        text.push_str(&")".repeat(open.len() + 1));
        (text, lines)
    }

    fn explain(&self, error: &SpannedError, lines: &[(usize, &str)], whole: &Origin) -> ConfigError {
        if let ron::Error::MissingStructField { field, outer: Some(outer) } = &error.code
            && outer == "Experiment"
        {
            return whole.error((1, 1), format!("`{field}` is missing"));
        }
        let at = error.span.start;
        let found = lines.iter().rev().find(|(line, _)| *line <= at.line);
        match found.and_then(|(line, key)| Some((line, *key, self.0.get(*key)?))) {
            Some((line, key, value)) => {
                let message = type_message(&error.code, key, &value.text, || self.valid_names(key));
                value.origin.error((at.line - line + 1, at.col), message)
            }
            None => whole.error((1, 1), error.code.to_string()),
        }
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
