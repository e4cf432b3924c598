//! Reading an experiment from a RON file, with errors one can act on.
//!
//! `base: ["coinrun-ppo", "mine.ron"]` at the top of a file names what it is built on: presets by name, files by their
//! path from the file's own folder. Each is laid over the ones before it, and the file's own keys over all of them, key by
//! key; a list is one value. A base may have a base of its own.

use std::path::Path;

use super::{
    config::{Experiment, ExperimentError},
    config_keys::{Keys, Origin},
    presets::Preset,
};

pub use super::config_error::ConfigError;

/// Files below one another, at most: more means that they go round in a circle.
const MAX_DEPTH: usize = 8;

/// Reads and checks an experiment.
///
/// # Errors
///
/// [`ConfigError`] with file, line and column.
pub fn read_experiment(path: &Path) -> Result<Experiment, ConfigError> {
    parse_experiment_with::<&str>(&read(path)?, path, &[])
}

/// Reads an experiment, puts each `key=value` into it (see [`Experiment::with_set`]) and checks the result.
///
/// # Errors
///
/// [`ConfigError`] with file, line and column, or with the `key=value` that does not fit.
pub fn read_experiment_with<S: AsRef<str>>(path: &Path, sets: &[S]) -> Result<Experiment, ConfigError> {
    parse_experiment_with(&read(path)?, path, sets)
}

/// As [`read_experiment_with`], from a text; `path` as for [`parse_experiment`].
///
/// # Errors
///
/// [`ConfigError`].
pub fn parse_experiment_with<S: AsRef<str>>(text: &str, path: &Path, sets: &[S]) -> Result<Experiment, ConfigError> {
    let own = parse_experiment(text, path)?;
    let experiment = own.with_set(sets)?;
    match experiment.check() {
        Ok(()) => Ok(experiment),
        Err(source) => Err(blame(&own, sets, source, path)),
    }
}

/// Who is to blame for values that do not go together: the file, if it is no better without the sets; otherwise those
/// sets without which the error would be gone, or all of them together.
fn blame<S: AsRef<str>>(own: &Experiment, sets: &[S], source: ExperimentError, path: &Path) -> ConfigError {
    let fails = |sets: &[&str]| own.with_set(sets).is_ok_and(|changed| changed.check().as_ref() == Err(&source));
    if fails(&[]) {
        return ConfigError::Values { path: path.into(), source };
    }
    let all: Vec<&str> = sets.iter().map(AsRef::as_ref).collect();
    let without = |left_out: usize| -> Vec<&str> {
        all.iter().enumerate().filter(|(at, _)| *at != left_out).map(|(_, set)| *set).collect()
    };
    let mut sets: Vec<String> =
        (0..all.len()).filter(|&at| !fails(&without(at))).map(|at| all[at].to_owned()).collect();
    if sets.is_empty() {
        sets = all.into_iter().map(str::to_owned).collect();
    }
    ConfigError::Sets { sets, source: source.into() }
}

/// Parses the text of an experiment. `path` is for messages and says where to look for files that it is built on.
///
/// # Errors
///
/// [`ConfigError::Syntax`], also for what it is built on; [`ConfigError::Read`] if that cannot be read.
pub fn parse_experiment(text: &str, path: &Path) -> Result<Experiment, ConfigError> {
    gather(text, path, 0)?.parse(&Origin::start_of(path))
}

fn read(path: &Path) -> Result<String, ConfigError> {
    std::fs::read_to_string(path).map_err(|source| ConfigError::Read { path: path.into(), source })
}

/// The keys of a file over those of what it is built on. Each file is checked alone, so that a wrong value is found even
/// if a later one hides it.
fn gather(text: &str, path: &Path, depth: usize) -> Result<Keys, ConfigError> {
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
        if depth == MAX_DEPTH {
            return Err(base.origin.error((1, 1), format!("`base` goes round in a circle, or {MAX_DEPTH} files deep")));
        }
        for name in names {
            keys = keys.overlaid(&gather_base(&name, path, depth + 1, &base.origin)?);
        }
    }
    Ok(keys.overlaid(&own))
}

fn gather_base(name: &str, user: &Path, depth: usize, origin: &Origin) -> Result<Keys, ConfigError> {
    if name.ends_with(".ron") {
        let path = user.with_file_name(name);
        let text = std::fs::read_to_string(&path).map_err(|error| {
            origin.error((1, 1), format!("`base` names {}, which cannot be read: {error}", path.display()))
        })?;
        return gather(&text, &path, depth);
    }
    let preset = Preset::find(name)
        .map_err(|error| origin.error((1, 1), format!("{error}; or a file, by its path ending in .ron")))?;
    gather(preset.text, Path::new(&format!("assets/presets/{name}.ron")), depth)
}

#[cfg(test)]
mod tests;
