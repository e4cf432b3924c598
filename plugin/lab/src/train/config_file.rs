//! Experiment files in RON.
//!
//! `base: ["coinrun-ppo", "mine.ron"]` at the top of a file names its bases: presets by name, files by their path from
//! the file's own folder. Each overrides the ones before it, and the file's own keys override all of them, key by key;
//! a list is one value. A base may have a base of its own. The number of bases and the length of a file are limited,
//! which keeps hostile files from taking forever.

use std::path::{Path, PathBuf};

use super::{
    config::{Experiment, ExperimentError},
    config_error::Origin,
    config_keys::Keys,
    presets::find_preset,
};
use crate::text_file::read_text_file;

pub use super::config_error::ConfigError;

/// Largest depth of bases.
const MAX_DEPTH: usize = 8;

/// Largest number of bases of an experiment, each counted as often as it is named.
const MAX_BASES: usize = 64;

/// Largest size of a file in bytes. The longest experiments have a few thousand.
const MAX_BYTES: u64 = 1 << 20;

/// The files that are being read for one experiment.
#[derive(Default)]
struct Reading {
    /// Files that have the current one as a base, the outermost first.
    users: Vec<PathBuf>,
    /// Files and presets read so far, beside the experiment itself.
    bases: usize,
}

/// Reads and checks an experiment.
///
/// # Errors
///
/// [`ConfigError`] with file, line and column.
pub fn read_experiment(path: &Path) -> Result<Experiment, ConfigError> {
    parse_experiment_with::<&str>(&read_experiment_text(path)?, path, &[])
}

/// Reads an experiment, puts each `key=value` into it (see [`Experiment::with_set`]) and checks the result.
///
/// # Errors
///
/// [`ConfigError`] with file, line and column, or with the `key=value` that does not fit.
pub fn read_experiment_with<S: AsRef<str>>(path: &Path, sets: &[S]) -> Result<Experiment, ConfigError> {
    parse_experiment_with(&read_experiment_text(path)?, path, sets)
}

/// Reads an experiment as [`read_experiment_with`] does, from a text; `path` as for [`parse_experiment`].
///
/// # Errors
///
/// [`ConfigError`].
pub fn parse_experiment_with<S: AsRef<str>>(text: &str, path: &Path, sets: &[S]) -> Result<Experiment, ConfigError> {
    let keys = gather(text, path, &mut Reading::default())?;
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
    placed(&gather(text, path, &mut Reading::default()).unwrap_or_default(), sets, source, path)
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

/// Parses the text of an experiment. Messages name `path`, and paths of bases start in its folder.
///
/// # Errors
///
/// [`ConfigError::Syntax`], also for its bases; [`ConfigError::Read`] if one of them cannot be read.
pub fn parse_experiment(text: &str, path: &Path) -> Result<Experiment, ConfigError> {
    gather(text, path, &mut Reading::default())?.parse(&Origin::start_of(path))
}

/// Reads the text of an experiment file, of at most 1 MiB.
///
/// # Errors
///
/// [`ConfigError::Read`] if there is no regular file, or it is longer, or it is not a text.
pub fn read_experiment_text(path: &Path) -> Result<String, ConfigError> {
    read_text_file(path, MAX_BYTES).map_err(|error| ConfigError::Read { path: path.into(), source: error.into() })
}

/// Collects the keys of a file over those of its bases. Each file is checked alone: a wrong value is reported even if a
/// later one overrides it.
fn gather(text: &str, path: &Path, reading: &mut Reading) -> Result<Keys, ConfigError> {
    let start = Origin::start_of(path);
    let mut own = Keys::of_text(text, path)?;
    let base = own.take("base");
    own.check_names()?;
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
        return gather(&text, &path, reading);
    }
    let preset = find_preset(name)
        .map_err(|error| origin.error((1, 1), format!("{error}; or a file, by its path ending in .ron")))?;
    gather(preset.text, &path, reading)
}

#[cfg(test)]
mod limits_tests;
#[cfg(test)]
mod tests;
