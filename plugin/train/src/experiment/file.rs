//! Experiment files in RON.
//!
//! An experiment is read as a list of keys with their values as text: files, presets and `--set` override one another
//! key by key. Types are checked once, when the result is parsed; errors then lead back to the position of the value.
//!
//! `base: ["coinrun-ppo", "mine.ron"]` at the top of a file names its bases: presets by name, files by their path from
//! the file's own folder. Each overrides the ones before it, and the file's own keys override all of them, key by key;
//! a list is one value. A base may have a base of its own. The number of bases and the length of a file are limited,
//! which keeps hostile files from taking forever.
//!
//! Other relative paths in a file, those of recordings and of level files, start in the file's own folder too if
//! something is there, and else in the current folder.

#[cfg(test)]
mod limits_tests;
#[cfg(test)]
mod tests;

use crate::experiment::{
    Experiment, ExperimentError, Variant,
    error::Origin,
    find_preset,
    keys::{all, find, is_section, missing_key, no_value, renamed, syntax_message, type_message, unknown_key},
};
use playbot_harness::{
    level_files::{LevelFileError, find_level_files, level_file_pattern, level_files_mode, read::read_text_file},
    split::{LevelSplit, SplitError},
};
use playbot_learner::settings::Reader;
use ron::{Options, error::SpannedError, extensions::Extensions, value::RawValue};
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor},
};
use std::{
    collections::BTreeMap,
    fmt,
    path::{Path, PathBuf},
    sync::LazyLock,
};

pub use crate::experiment::error::ConfigError;

/// Largest depth of bases.
const MAX_DEPTH: usize = 8;

/// Largest number of bases of an experiment, each counted as often as it is named.
const MAX_BASES: usize = 64;

/// Largest size of a file in bytes. The longest experiments have a few thousand.
const MAX_BYTES: u64 = 1 << 20;

/// Reads and checks an experiment.
///
/// # Errors
///
/// [`ConfigError`] with file, line and column.
pub fn read_experiment(path: &Path) -> Result<Experiment, ConfigError> {
    read_experiment_with::<&str>(path, &[])
}

/// Reads an experiment, puts each `key=value` into it (see [`Experiment::with_set`]) and checks the result.
///
/// # Errors
///
/// [`ConfigError`] with file, line and column, or with the `key=value` that does not fit.
pub fn read_experiment_with<S: AsRef<str>>(path: &Path, sets: &[S]) -> Result<Experiment, ConfigError> {
    checked(&read_experiment_text(path)?, path, path.parent(), sets)
}

/// Reads an experiment as [`read_experiment_with`] does, from a text; `path` as for [`parse_experiment`].
///
/// # Errors
///
/// [`ConfigError`].
pub fn parse_experiment_with<S: AsRef<str>>(text: &str, path: &Path, sets: &[S]) -> Result<Experiment, ConfigError> {
    checked(text, path, None, sets)
}

/// Reads and checks an experiment; `folder` as for [`gather`].
fn checked<S: AsRef<str>>(
    text: &str,
    path: &Path,
    folder: Option<&Path>,
    sets: &[S],
) -> Result<Experiment, ConfigError> {
    let keys = gather(text, path, folder, &mut Reading::default())?;
    let own = keys.parse(&Origin::start_of(path))?;
    let experiment = own.with_set(sets)?;
    match experiment.check() {
        Ok(()) => Ok(experiment),
        Err(source) => {
            let fails =
                |sets: &[&str]| own.with_set(sets).is_ok_and(|changed| changed.check().as_ref() == Err(&source));
            let sets = if fails(&[]) { Vec::new() } else { blame(sets, fails) };
            Err(placed(&keys, sets, source, path))
        }
    }
}

/// Adds the position of the wrong key to an error that was found after reading, such as one about the game. Text, path
/// and sets are those that the experiment was read from.
pub fn locate<S: AsRef<str>>(text: &str, path: &Path, sets: &[S], source: ExperimentError) -> ConfigError {
    let keys = source.keys();
    // A set may change a whole section, and the error may name a section.
    let sets_it = |set: &&str| {
        let name = set.split_once('=').map_or("", |(name, _)| name.trim());
        let is_within = |inner: &str, outer: &str| inner.strip_prefix(outer).is_some_and(|rest| rest.starts_with('.'));
        keys.iter().any(|key| name == *key || is_within(key, name) || is_within(name, key))
    };
    let sets = sets.iter().map(AsRef::as_ref).filter(sets_it).map(str::to_owned).collect();
    let keys = gather(text, path, path.parent(), &mut Reading::default()).unwrap_or_default();
    placed(&keys, sets, source, path)
}

/// Returns an error of these sets, or of the position in a file if there are none.
fn placed(keys: &Keys, sets: Vec<String>, source: ExperimentError, path: &Path) -> ConfigError {
    if !sets.is_empty() {
        return ConfigError::Sets { sets, source: source.into() };
    }
    let (path, at) = source.keys().into_iter().find_map(|key| keys.place(key)).unwrap_or((path, (1, 1)));
    ConfigError::Values { path: path.into(), at, source: source.into() }
}

/// Returns the sets without which the error would be gone, or all of them together.
fn blame<S: AsRef<str>>(sets: &[S], fails: impl Fn(&[&str]) -> bool) -> Vec<String> {
    let all: Vec<&str> = sets.iter().map(AsRef::as_ref).collect();
    let without = |left_out: usize| -> Vec<&str> {
        all.iter().enumerate().filter(|(at, _)| *at != left_out).map(|(_, set)| *set).collect()
    };
    let guilty: Vec<String> = (0..all.len()).filter(|&at| !fails(&without(at))).map(|at| all[at].to_owned()).collect();
    if guilty.is_empty() { all.into_iter().map(str::to_owned).collect() } else { guilty }
}

/// Parses the text of an experiment. Messages name `path`, and paths of bases start in its folder. Other relative paths
/// in the text start in the current folder.
///
/// # Errors
///
/// [`ConfigError::Syntax`], also for its bases; [`ConfigError::Read`] if one of them cannot be read.
pub fn parse_experiment(text: &str, path: &Path) -> Result<Experiment, ConfigError> {
    gather(text, path, None, &mut Reading::default())?.parse(&Origin::start_of(path))
}

/// Reads the text of an experiment file, of at most 1 MiB.
///
/// # Errors
///
/// [`ConfigError::Read`] if there is no regular file, or it is longer, or it is not a text.
pub fn read_experiment_text(path: &Path) -> Result<String, ConfigError> {
    read_text_file(path, MAX_BYTES).map_err(|error| ConfigError::Read { path: path.into(), source: error.into() })
}

/// The files that are being read for one experiment.
#[derive(Default)]
struct Reading {
    /// Files that have the current one as a base, the outermost first.
    users: Vec<PathBuf>,
    /// Files and presets read so far, beside the experiment itself.
    bases: usize,
}

/// Collects the keys of a file over those of its bases. Each file is checked alone: a wrong value is reported even if a
/// later one overrides it. Relative paths start in `folder` if something is there.
fn gather(text: &str, path: &Path, folder: Option<&Path>, reading: &mut Reading) -> Result<Keys, ConfigError> {
    let start = Origin::start_of(path);
    let mut own = Keys::of_text(text, path)?;
    let base = own.take("base");
    own.check_names()?;
    if let Some(folder) = folder.filter(|folder| !is_current(folder)) {
        own.start_in(folder)?;
    }
    Keys::all().clone().overlaid(&own).parse(&start)?;
    let mut keys = Keys::default();
    if let Some(base) = base {
        let names: Vec<String> = ron::from_str(&base.text).map_err(|_| {
            let message = "`base` must be a list of presets and files, such as [\"coinrun-ppo\", \"mine.ron\"]";
            base.origin.error((1, 1), message.to_owned())
        })?;
        reading.users.push(path.into());
        for name in names {
            keys = keys.overlaid(&gather_base(&name, reading, &base.origin)?);
        }
        reading.users.pop();
    }
    Ok(keys.overlaid(&own))
}

fn gather_base(name: &str, reading: &mut Reading, origin: &Origin) -> Result<Keys, ConfigError> {
    let users = &reading.users;
    let user = users.last().cloned().unwrap_or_default();
    let path =
        if name.ends_with(".ron") { user.with_file_name(name) } else { format!("assets/presets/{name}.ron").into() };
    let chain = || {
        let files: Vec<String> = users.iter().chain([&path]).map(|file| file.display().to_string()).collect();
        files.join(" → ")
    };
    let same = |known: &PathBuf| {
        *known == path || known.canonicalize().is_ok_and(|known| path.canonicalize().is_ok_and(|path| path == known))
    };
    if users.iter().any(same) {
        return Err(origin.error((1, 1), format!("`base` goes round in a circle: {}", chain())));
    }
    if users.len() > MAX_DEPTH {
        return Err(origin.error((1, 1), format!("`base` goes more than {MAX_DEPTH} files deep: {}", chain())));
    }
    if reading.bases == MAX_BASES {
        let first = users.first().cloned().unwrap_or_default();
        let message =
            format!("{} is built on more than {MAX_BASES} files and presets: `base` may name fewer", first.display());
        return Err(origin.error((1, 1), message));
    }
    reading.bases += 1;
    if name.ends_with(".ron") {
        let text = read_text_file(&path, MAX_BYTES).map_err(|error| {
            origin.error((1, 1), format!("`base` names {}, which cannot be read: {error}", path.display()))
        })?;
        return gather(&text, &path, path.parent(), reading);
    }
    let preset = find_preset(name)
        .map_err(|error| origin.error((1, 1), format!("{error}; or a file, by its path ending in .ron")))?;
    gather(preset.text, &path, None, reading)
}

// Paths in a file.

/// Keys with paths: recordings, and levels that may be files.
const PATHS: [&str; 3] = ["demos", "train", "test"];

/// Key of the lessons, whose levels may be files too.
const LESSONS: &str = "curriculum.lessons";

/// Returns true if a folder is the current one.
fn is_current(folder: &Path) -> bool {
    folder.as_os_str().is_empty()
        || folder.canonicalize().is_ok_and(|folder| Path::new(".").canonicalize().is_ok_and(|here| here == folder))
}

/// Returns the value of a key with its path behind `folder`, if something is there.
///
/// # Errors
///
/// Level files that are neither there nor in the current folder.
fn beside(folder: &Path, key: &str, value: &str) -> Result<Option<String>, String> {
    if key == "demos" {
        let path = folder.join(value);
        let is_there = Path::new(value).is_relative() && !["", "None"].contains(&value) && path.exists();
        return Ok(path.to_str().filter(|_| is_there).map(str::to_owned));
    }
    let Some(pattern) = level_file_pattern(value).filter(|pattern| Path::new(pattern).is_relative()) else {
        return Ok(None);
    };
    let there = folder.to_str().map(|folder| format!("{}/{pattern}", level_files_mode(folder)));
    if let Some(there) = there.filter(|there| find_levels(there).is_ok()) {
        return Ok(Some(there));
    }
    match find_levels(value) {
        Err(SplitError::Files(LevelFileError::NoFiles { pattern, folder: here })) => Err(format!(
            "files:{pattern} matches no file, neither seen from {}, the folder of this file, nor from {here}: name level \
             files, as in files:levels/**/*.json",
            folder.display()
        )),
        // Other mistakes are reported when the value is parsed.
        _ => Ok(None),
    }
}

/// Finds the files of `files:PATTERN`, with or without a range.
fn find_levels(levels: &str) -> Result<(), SplitError> {
    let split: LevelSplit = levels.parse()?;
    find_level_files(level_file_pattern(&split.mode).unwrap_or_default())?;
    Ok(())
}

impl Keys {
    /// Puts `folder` in front of the paths of recordings and level files that lie there.
    ///
    /// # Errors
    ///
    /// Level files that are neither there nor in the current folder.
    fn start_in(&mut self, folder: &Path) -> Result<(), ConfigError> {
        for key in PATHS {
            // Values of other types are refused when they are parsed.
            let Some(value) = self.0.get_mut(key) else { continue };
            let Ok(Some(path)) = reader().from_str::<Option<String>>(&value.text) else { continue };
            let refuse = |message: String| value.origin.error((1, 1), message);
            if let Some(found) = beside(folder, key, &path).map_err(refuse)? {
                value.text = ron::to_string(&found).map_err(|error| refuse(error.to_string()))?;
            }
        }
        self.start_lessons_in(folder)?;
        let Some(value) = self.0.get_mut("variants") else { return Ok(()) };
        let Ok(mut variants) = reader().from_str::<Vec<Variant>>(&value.text) else { return Ok(()) };
        let refuse = |message: String| value.origin.error((1, 1), message);
        let mut is_changed = false;
        for set in variants.iter_mut().flat_map(|variant| &mut variant.set) {
            let Some((key, text)) = set.split_once('=').map(|(key, text)| (key.trim(), text.trim())) else { continue };
            if !PATHS.contains(&key) {
                continue;
            }
            let path = ron::from_str::<String>(text).unwrap_or_else(|_| text.to_owned());
            if let Some(found) = beside(folder, key, &path).map_err(refuse)? {
                *set = format!("{key}={found}");
                is_changed = true;
            }
        }
        if is_changed {
            value.text = ron::to_string(&variants).map_err(|error| refuse(error.to_string()))?;
        }
        Ok(())
    }
}

/// A lesson whose levels are a text: files in it are looked for later.
#[derive(Serialize, Deserialize)]
struct WrittenLesson {
    levels: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    success: Option<f64>,
}

impl Keys {
    /// Puts `folder` in front of the level files of lessons that lie there, as [`start_in`](Self::start_in) does.
    fn start_lessons_in(&mut self, folder: &Path) -> Result<(), ConfigError> {
        let Some(value) = self.0.get_mut(LESSONS) else { return Ok(()) };
        // Values of other types are refused when they are parsed.
        let Ok(mut lessons) = reader().from_str::<Vec<WrittenLesson>>(&value.text) else { return Ok(()) };
        let refuse = |message: String| value.origin.error((1, 1), message);
        let mut is_changed = false;
        for lesson in &mut lessons {
            if let Some(found) = beside(folder, LESSONS, &lesson.levels).map_err(refuse)? {
                (lesson.levels, is_changed) = (found, true);
            }
        }
        if is_changed {
            value.text = ron::to_string(&lessons).map_err(|error| refuse(error.to_string()))?;
        }
        Ok(())
    }
}

impl Experiment {
    /// Returns this experiment with each `key=value` put into it, in order. A key in a section has its path, such as
    /// `ppo.lr=0.0003`; values are written as in a file, and texts may lack their quotes: `train=hard:0..31`. A whole
    /// section is changed key by key: `ppo=(lr: 0.0003, epochs: 4)`.
    ///
    /// [`check`](Self::check) then finds values that contradict one another.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Set`] with the wrong text: no `=`, an unknown key, or a value of the wrong type.
    pub fn with_set<S: AsRef<str>>(&self, sets: &[S]) -> Result<Self, ConfigError> {
        sets.iter().try_fold(self.clone(), |experiment, set| put(&experiment, set.as_ref()))
    }

    /// Returns whether the algorithm reads this key, or some key in this section. A key that another one turns off,
    /// such as `score.kl_coef` without `score.kl`, counts as read.
    pub fn reads(&self, key: &str) -> bool {
        let key = renamed(key).unwrap_or(key);
        let is_asked = |path: &str| path.strip_prefix(key).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
        let mut asked = all().filter(|setting| is_asked(setting.path)).peekable();
        asked.peek().is_none() || asked.any(|setting| self.is_among(setting.readers))
    }

    fn is_among(&self, readers: &[Reader]) -> bool {
        let is_this = |reader: &Reader| {
            reader.algorithm == self.algorithm.name() && reader.switch.is_none_or(|switch| self.is_on(switch))
        };
        readers.is_empty() || readers.iter().any(is_this)
    }

    fn is_on(&self, switch: &str) -> bool {
        let origin = Origin::Set(String::new());
        Keys::of_experiment(self, &origin).is_ok_and(|keys| keys.text(switch) == Some("true"))
    }
}

fn put(experiment: &Experiment, set: &str) -> Result<Experiment, ConfigError> {
    let origin = Origin::Set(set.to_owned());
    let refuse = |message: String| origin.error((1, 1), message);
    let Some((key, text)) = set.split_once('=') else {
        return Err(refuse("write key=value, such as ppo.lr=0.0003".to_owned()));
    };
    let (key, text) = (renamed(key.trim()).unwrap_or(key.trim()), text.trim());
    if key == "base" {
        return Err(refuse("`base` names what a file is built on: write it into an experiment file".to_owned()));
    }
    let mut keys = Keys::of_experiment(experiment, &origin)?;
    if is_section(key) && text.starts_with('(') {
        let section = Keys::of_set(key, text, &origin)?;
        section.check_names()?;
        return keys.overlaid(&section).parse(&origin);
    }
    let Some(setting) = find(key) else {
        return Err(refuse(unknown_key(key)));
    };
    if text == "None" {
        // A text may lack its quotes, but `None` takes the value of an optional key away.
        let mut without = keys.clone();
        without.put(key.to_owned(), Value { text: text.to_owned(), origin: origin.clone() });
        if let Ok(experiment) = without.parse(&origin) {
            return Ok(experiment);
        }
    }
    let text = if setting.sample().starts_with('"') && !text.starts_with('"') {
        ron::to_string(text).map_err(|error| refuse(error.to_string()))?
    } else {
        text.to_owned()
    };
    check_syntax(&text).map_err(|error| refuse(no_value(key, &text, &error.code)))?;
    keys.put(key.to_owned(), Value { text, origin: origin.clone() });
    keys.parse(&origin)
}

// Keys with their values as text.

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

#[cfg(test)]
mod config_set_tests {
    use std::path::Path;

    use playbot_learner::{
        ConfidenceKind, EntropyCoef, StdKind,
        nn::{Activation, CnnKind},
    };

    use super::*;
    use crate::Algorithm;
    use bevy_playbot::vision::{ImageOptions, ObservationKind};

    fn experiment() -> Experiment {
        let text = r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "demos/coinrun", steps: 1000,
            ppo: (gamma: 0.5, epochs: 7))"#;
        parse_experiment(text, Path::new("x.ron")).expect("valid")
    }

    fn error(set: &str) -> String {
        experiment().with_set(&[set]).expect_err("must be refused").to_string()
    }

    #[test]
    fn every_setting_of_the_tables_can_be_set_and_has_the_default_of_its_row() {
        let text = r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", steps: 1000)"#;
        let least = parse_experiment(text, Path::new("x.ron")).expect("valid");
        for setting in all() {
            let with = |value: String| least.with_set(&[format!("{}={value}", setting.path)]).expect(setting.path);
            with(setting.sample());
            if let Some(default) = setting.default {
                assert_eq!(with(default()), least, "{}", setting.path);
            }
        }
    }

    #[test]
    fn keys_that_are_not_written_as_long_as_they_do_nothing_can_be_set() {
        let sets = [
            "skills.held_out=0.1",
            "skills.anneal_lr=true",
            "skills.patience=3",
            "skills.weight_decay=0.01",
            "skills.augment=[Translate(2)]",
            "skills.state_weight=2",
            "ppo.curiosity=Rnd(share: 0.5)",
        ];
        let Experiment { skills, ppo, .. } = experiment().with_set(&sets).expect("known keys");
        let text = serde_json::to_string(&ppo.curiosity).expect("plain values");
        assert!(text.starts_with(r#"{"Rnd":{"extrinsic":2.0,"#) && text.contains(r#""share":0.5"#), "{text}");
        assert_eq!((skills.held_out, skills.patience, skills.weight_decay), (0.1, Some(3), 0.01));
        assert!(skills.anneal_lr);
        assert_eq!(skills.state_weight, 2.0);
        assert_eq!(skills.augment.len(), 1);
        let older = experiment().with_set(&["sac.alpha_lr=0.5"]).expect("an older name");
        assert_eq!(older.sac.temperature_lr, 0.5);
    }

    #[test]
    fn values_of_every_kind_are_set_and_nothing_else_is() {
        let sets = [
            "score.kl=false",
            "arenas=32",
            "score.kl_coef = 0.3",
            "ppo.lr=1",
            "ppo.hidden=[64,64]",
            "ppo.activation=Tanh",
            "score.alpha=Off",
            "skills.prior_std=Vector",
            "ppo.total_updates=Some(3)",
            "sac.entropy=Fixed(0.5)",
            "sac.log_std=(-4, 1)",
            "train=hard:0..31",
            "test=\"hard:70..80\"",
            "demos=my recordings/a",
            "demo_steps=5000",
            "demo_wins=true",
            "observation=Raster",
            "image.stack=4",
            "image=(grayscale: true, width: 84)",
            "ppo.cnn=Nature(feature: 64)",
            "algorithm=bc",
            "seeds=[4, 5]",
            "variants=[(name: \"a\", set: [\"score.kl=true\"])]",
        ];
        let mut expected = experiment();
        expected.score.kl = false;
        expected.arenas = 32;
        expected.score.kl_coef = 0.3;
        expected.ppo.lr = 1.0;
        expected.ppo.hidden = vec![64, 64];
        expected.ppo.activation = Activation::Tanh;
        expected.score.confidence = ConfidenceKind::Off;
        expected.skills.prior_std = StdKind::Vector;
        expected.ppo.total_updates = Some(3);
        expected.sac.entropy = EntropyCoef::Fixed(0.5);
        expected.sac.log_std = (-4.0, 1.0);
        expected.train = "hard:0..31".parse().expect("a split");
        expected.test = "hard:70..80".parse().expect("a split");
        expected.demos = Some("my recordings/a".into());
        expected.demo_steps = Some(5000);
        expected.demo_wins = true;
        expected.observation = ObservationKind::Raster;
        expected.image = ImageOptions { stack: 4, grayscale: true, width: 84, ..ImageOptions::default() };
        expected.ppo.cnn = CnnKind::Nature { feature: 64 };
        expected.algorithm = Algorithm::BehaviourCloning;
        expected.seeds = vec![4, 5];
        expected.variants = vec![crate::experiment::Variant { name: "a".into(), set: vec!["score.kl=true".into()] }];
        let changed = experiment().with_set(&sets).expect("valid");
        assert_eq!(changed, expected);
        let back = changed.with_set(&["ppo.total_updates=None"]).expect("valid");
        assert_eq!(back.ppo.total_updates, None);
        let without = changed.with_set(&["demos=None"]).expect("not all need some");
        assert_eq!(without.demos, None);
        assert_eq!(without.with_set(&["demos=None/a"]).expect("a path").demos, Some("None/a".into()));
        assert_eq!(back.with_set(&["ppo.total_updates=9"]).expect("Some is understood").ppo.total_updates, Some(9));
    }

    #[test]
    fn a_section_is_changed_key_by_key_and_the_last_one_wins() {
        let changed = experiment().with_set(&["ppo=(lr: 0.25, epochs: 2)", "ppo.lr=0.5"]).expect("valid");
        assert_eq!((changed.ppo.lr, changed.ppo.epochs, changed.ppo.gamma), (0.5, 2, 0.5));
    }

    #[test]
    fn what_does_not_fit_is_named_with_what_was_given() {
        for (set, words) in [
            ("ppo.lr", "write key=value"),
            ("ppo.gama=1", "unknown key `ppo.gama`; did you mean `ppo.gamma`?"),
            ("sac.lr=1", "unknown key `sac.lr`; did you mean `sac.actor_lr`?"),
            (
                "ppo.augment=[Translate]",
                "`ppo.augment` must be a list in square brackets such as [Translate(1)], not [Translate]",
            ),
            ("kl_coef=1", "did you mean `score.kl_coef`?"),
            ("image.stak=2", "did you mean `image.stack`?"),
            ("stack=2", "did you mean `image.stack`?"),
            ("imag.width=32", "did you mean `image.width`?"),
            ("image=(stack: 2, gray: true)", "unknown key `image.gray`; did you mean `image.grayscale`?"),
            ("image.stack=-1", "`image.stack` must be a whole number such as 1, not -1"),
            ("observation=raster", "did you mean `Raster`?"),
            ("ppo.cnn=Natur", "did you mean `Nature`?"),
            ("pop.lr=1", "did you mean `ppo.lr`?"),
            ("ppo.qqq=1", "valid keys in `ppo`: activation"),
            ("steps.more=1", "`steps` has no keys"),
            ("ppo=3", "`ppo` is a section"),
            ("ppo=(gama: 1)", "did you mean `ppo.gamma`?"),
            ("ppo.lr=fast", "`ppo.lr` must be a number such as 0.0005, not fast"),
            ("ppo.lr=", "`ppo.lr` must be a number"),
            ("arenas=-3", "`arenas` must be a whole number such as 64, not -3"),
            ("score.kl=yes", "`score.kl` must be true or false, not yes"),
            ("ppo.hidden=[64,a]", "`ppo.hidden` must be a list in square brackets such as [200, 200], not [64,a]"),
            ("ppo.activation=Rellu", "did you mean `Relu`?"),
            ("sac.entropy=Fixd(0.2)", "did you mean `Fixed`?"),
            ("sac.entropy=Fixed(high)", "`sac.entropy` must be something such as Auto("),
            ("sac.entropy=Auto(initail: 1.0)", "unknown key `initail` in `sac.entropy`; did you mean `initial`?"),
            ("sac.log_std=3", "values in round brackets such as (-5.0, 2.0), not 3"),
            ("ppo.total_updates=soon", "`ppo.total_updates` must be None or Some(value), not soon"),
            ("train=hard", "`hard` is not a range of levels"),
            ("algorithm=score", "unknown algorithm `score`"),
            ("base=[]", "experiment file"),
            // A text must not reach beyond the value.
            ("ppo.lr=0.1, gamma: 0.9", "is not a value"),
            ("ppo.lr=0.1), score: (kl: false", "is not a value"),
        ] {
            let text = error(set);
            assert!(text.starts_with(&format!("`{set}`: ")) && text.contains(words), "{text}");
        }
    }

    /// Returns those of the keys that an experiment reads.
    fn read(settings: &str, keys: &[&'static str]) -> Vec<&'static str> {
        let text = format!(r#"(game: "g", train: "a:0..3", test: "a:4..7", demos: "d", steps: 10, {settings})"#);
        let experiment = parse_experiment(&text, Path::new("x.ron")).expect("valid");
        keys.iter().copied().filter(|key| experiment.reads(key)).collect()
    }

    #[test]
    fn sections_of_other_algorithms_are_not_read() {
        let keys = ["steps", "ppo.lr", "sac", "skills.latent", "score.kl", "spirl.kl_coef", "rlpd.critics"];
        let of = |algorithm: &str| read(&format!("algorithm: {algorithm:?}"), &keys);
        assert_eq!(of("ppo"), ["steps", "ppo.lr"]);
        assert_eq!(of("score-ppo"), ["steps", "ppo.lr", "skills.latent", "score.kl"]);
        assert_eq!(of("score-sac"), ["steps", "sac", "skills.latent", "score.kl"]);
        assert_eq!(of("spirl-ppo"), ["steps", "ppo.lr", "skills.latent", "spirl.kl_coef"]);
        assert_eq!(of("spirl-sac"), ["steps", "sac", "skills.latent", "spirl.kl_coef"]);
        assert_eq!(of("rlpd"), ["steps", "sac", "rlpd.critics"]);
        assert_eq!(of("bc"), ["steps", "skills.latent"]);
    }

    #[test]
    fn nor_is_what_an_algorithm_has_in_their_place() {
        let keys = [
            "sac.critics",
            "sac.layer_norm",
            "sac.entropy",
            "sac.tau",
            "ppo.ent_coef",
            "ppo.lr",
            "score.kl_coef",
            "score.horizon",
        ];
        let of = |settings: &str| read(settings, &keys);
        assert_eq!(of(r#"algorithm: "rlpd""#), ["sac.entropy", "sac.tau"]);
        assert_eq!(of(r#"algorithm: "sac""#), ["sac.critics", "sac.layer_norm", "sac.entropy", "sac.tau"]);
        assert_eq!(of(r#"algorithm: "spirl-ppo""#), ["ppo.lr", "score.horizon"]);
        let learns = "spirl: (learn_decoder: true)";
        assert_eq!(
            of(&format!(r#"algorithm: "spirl-ppo", {learns}"#)),
            ["ppo.ent_coef", "ppo.lr", "score.kl_coef", "score.horizon"]
        );
        assert_eq!(of(r#"algorithm: "spirl-sac""#), ["sac.critics", "sac.layer_norm", "sac.tau", "score.horizon"]);
        let both =
            ["sac.critics", "sac.layer_norm", "sac.tau", "ppo.ent_coef", "ppo.lr", "score.kl_coef", "score.horizon"];
        assert_eq!(of(&format!(r#"algorithm: "spirl-sac", {learns}"#)), both);
        assert_eq!(of(r#"algorithm: "bc""#), ["score.horizon"]);
    }
}
