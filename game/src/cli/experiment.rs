//! Finding and reading experiments, from a path or from those that come with the program.

use std::path::{Path, PathBuf};

use bevy_playbot::train::{
    Experiment,
    config_file::{ConfigError, parse_experiment, read_experiment},
};

/// The experiment of the quickstart, which also serves where none is named.
pub const COINRUN: &str = include_str!("../../../assets/experiments/coinrun.ron");

/// Reads an experiment file, or the built-in CoinRun experiment if none is named.
///
/// # Errors
///
/// [`ConfigError`] with file, line and column.
pub fn load(path: Option<&Path>) -> Result<Experiment, ConfigError> {
    match path {
        Some(path) => read_experiment(path),
        None => parse_experiment(COINRUN, Path::new("assets/experiments/coinrun.ron")),
    }
}

/// A path of the repository: as given if it exists, otherwise below the sources the program was built from, so that
/// `cargo run` works from any folder.
pub fn resolve(path: &Path) -> PathBuf {
    if path.exists() || path.is_absolute() {
        return path.into();
    }
    let below_sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    if below_sources.exists() { below_sources } else { path.into() }
}
