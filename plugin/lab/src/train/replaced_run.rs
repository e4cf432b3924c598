//! A run that makes room for another one: moved aside first, and removed when the new one stands.

use std::{
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
};

use super::{
    run_error::{RunError, io_error},
    run_lock::{LOCK_FILE, RunLock},
};

/// What a run was before another one took its place.
pub(super) struct ReplacedRun {
    run: PathBuf,
    /// Beside the run; `None` if there was nothing to move.
    folder: Option<PathBuf>,
}

impl ReplacedRun {
    /// Moves everything but the lock aside. What makes it a run goes first, so that no half run is left by a kill.
    pub(super) fn put_aside(run: &Path) -> Result<Self, RunError> {
        let mut names = names_in(run)?;
        names.retain(|name| name != LOCK_FILE);
        names.sort_by_key(|name| (name != "run.json", name == "experiment.ron"));
        let mut aside = Self { run: run.into(), folder: None };
        if names.is_empty() {
            return Ok(aside);
        }
        let mut name = run.file_name().unwrap_or_default().to_owned();
        name.push(format!(".replaced-{}", std::process::id()));
        let folder = run.with_file_name(name);
        fs::create_dir_all(&folder).map_err(io_error("create", &folder))?;
        aside.folder = Some(folder.clone());
        for name in names {
            if let Err(error) = fs::rename(run.join(&name), folder.join(&name)) {
                aside.put_back();
                return Err(io_error("replace", run)(error));
            }
        }
        Ok(aside)
    }

    /// Forgets it. The new run does not depend on whether this works.
    pub(super) fn remove(self) {
        if let Some(folder) = self.folder
            && let Err(error) = fs::remove_dir_all(&folder)
        {
            tracing::warn!("cannot remove the old run in {}: {error}", folder.display());
        }
    }

    /// Brings back what can be brought back, after something worse has gone wrong.
    pub(super) fn put_back(self) {
        let Some(folder) = self.folder else { return };
        for name in names_in(&folder).unwrap_or_default() {
            let _ = fs::rename(folder.join(&name), self.run.join(&name));
        }
        if fs::remove_dir(&folder).is_err() {
            tracing::warn!("the old run is in {}", folder.display());
        }
    }
}

fn names_in(folder: &Path) -> Result<Vec<OsString>, RunError> {
    let names = fs::read_dir(folder).and_then(|entries| entries.map(|entry| Ok(entry?.file_name())).collect());
    names.map_err(io_error("list", folder))
}

/// Checks that a folder holds a run, or nothing: anything else is never replaced.
///
/// # Errors
///
/// [`RunError::NotARun`].
pub fn check_replaceable(path: &Path) -> Result<(), RunError> {
    let is_known = path.join("run.json").is_file() || RunLock::is_known(path);
    if (is_known && path.join("experiment.ron").is_file()) || is_unstarted(path) {
        return Ok(());
    }
    Err(RunError::NotARun(path.into()))
}

/// Whether a folder holds at most what is written before `run.json`.
pub fn is_unstarted(path: &Path) -> bool {
    let first = |name: &str| {
        name == LOCK_FILE || ["experiment.ron", "run.json.tmp"].iter().any(|known| name.starts_with(known))
    };
    names_in(path).is_ok_and(|names| names.iter().all(|name| name.to_str().is_some_and(first)))
}

/// Whether a run can be begun in a folder without replacing anything: it is empty, or a run ended there before it began.
pub(super) fn is_free(path: &Path) -> bool {
    is_unstarted(path) && (RunLock::is_known(path) || names_in(path).is_ok_and(|names| names.is_empty()))
}
