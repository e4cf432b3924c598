//! A run that makes room for another one: moved aside first, and removed when the new one stands.

use std::{
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
};

use playbot_learner::disk;

use super::{
    run_error::{RunError, io_error},
    run_lock::{LOCK_FILE, RunLock},
};

/// Between the name of a run and the number of the process that replaces it.
const MARK: &str = ".replaced-";

/// What a study notes of the time that a run took: also of one that was stopped before it began, say while its skills were
/// learned.
const COST: &str = "cost.json";

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
        let keeps_cost = is_unstarted(run);
        names.retain(|name| name != LOCK_FILE && !(keeps_cost && name == COST));
        names.sort_by_key(|name| (name != "run.json", name == "experiment.ron"));
        let mut aside = Self { run: run.into(), folder: None };
        if names.is_empty() {
            return Ok(aside);
        }
        let mut name = run.file_name().unwrap_or_default().to_owned();
        name.push(format!("{MARK}{}", std::process::id()));
        let folder = run.with_file_name(name);
        disk::create_dir_all(&folder).map_err(io_error("create", &folder))?;
        aside.folder = Some(folder.clone());
        for name in names {
            if let Err(error) = disk::rename(&run.join(&name), &folder.join(&name)) {
                aside.put_back();
                return Err(io_error("replace", run)(error));
            }
        }
        Ok(aside)
    }

    /// Forgets it. The new run does not depend on whether this works.
    pub(super) fn remove(self) {
        if let Some(folder) = self.folder
            && let Err(error) = disk::remove_dir_all(&folder)
        {
            tracing::warn!("cannot remove the old run in {}: {error}", folder.display());
        }
    }

    /// Brings back what can be brought back, after something worse has gone wrong.
    pub(super) fn put_back(self) {
        let Some(folder) = self.folder else { return };
        for name in names_in(&folder).unwrap_or_default() {
            let _ = disk::rename(&folder.join(&name), &self.run.join(&name));
        }
        if disk::remove_dir(&folder).is_err() {
            tracing::warn!("the old run is in {}", folder.display());
        }
    }
}

/// Ends what a process that was killed while it replaced a run has left: the old run comes back if the new one had not begun,
/// and is removed if it had.
///
/// # Errors
///
/// [`RunError::Busy`] while the other process lives; [`RunError::Io`] if the folder cannot be written.
pub fn end_replacement(run: &Path) -> Result<(), RunError> {
    let leftovers = leftovers(run);
    if leftovers.is_empty() || !run.is_dir() {
        return Ok(());
    }
    let _lock = RunLock::take(run)?;
    for folder in leftovers {
        let aside = ReplacedRun { run: run.into(), folder: Some(folder.clone()) };
        let run = run.display();
        if aside.run.join("run.json").is_file() {
            tracing::warn!("{} is what {run} was before it was replaced, and is removed", folder.display());
            aside.remove();
        } else {
            tracing::warn!(
                "{run} was to be replaced, which was stopped before the new run began: the old one is brought back"
            );
            aside.put_back();
        }
    }
    Ok(())
}

/// The run whose parts a folder holds that is left of one which was replaced; `None` for any other folder.
pub(crate) fn run_of_leftover(folder: &Path) -> Option<PathBuf> {
    let name = folder.file_name()?.to_string_lossy();
    let (run, process) = name.rsplit_once(MARK)?;
    (!run.is_empty() && process.parse::<u32>().is_ok()).then(|| folder.with_file_name(run))
}

/// Whether parts of a run lie beside it.
pub(super) fn is_being_replaced(run: &Path) -> bool {
    !leftovers(run).is_empty()
}

/// The folders beside a run that hold parts of what it was.
fn leftovers(run: &Path) -> Vec<PathBuf> {
    let name_of = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let own = |folder: &PathBuf| run_of_leftover(folder).is_some_and(|of| name_of(&of) == name_of(run));
    let parent = run.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let names = names_in(parent).unwrap_or_default();
    names.into_iter().map(|name| run.with_file_name(name)).filter(own).collect()
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

/// Whether a run may be made in a folder, asked before it has taken long to get ready for it.
///
/// # Errors
///
/// [`RunError::Exists`] for a run unless `force`, [`RunError::NotARun`] for what is none, [`RunError::Io`] if an unfinished
/// replacement cannot be ended.
pub fn check_new(path: &Path, force: bool) -> Result<(), RunError> {
    end_replacement(path)?;
    if !path.exists() {
        return Ok(());
    }
    check_replaceable(path)?;
    match (force || is_free(path), is_unstarted(path)) {
        (true, _) => Ok(()),
        (false, true) => Err(RunError::NotARun(path.into())),
        (false, false) => Err(RunError::Exists(path.into())),
    }
}

/// Whether a folder holds at most what is written before `run.json`.
pub fn is_unstarted(path: &Path) -> bool {
    let first = |name: &str| {
        name == LOCK_FILE
            || name == COST
            || ["experiment.ron", "run.json.tmp", "cost.json.tmp"].iter().any(|known| name.starts_with(known))
    };
    names_in(path).is_ok_and(|names| names.iter().all(|name| name.to_str().is_some_and(first)))
}

/// Whether a run can be begun in a folder without replacing anything: it is empty, or a run ended there before it began.
pub(super) fn is_free(path: &Path) -> bool {
    is_unstarted(path) && (RunLock::is_known(path) || names_in(path).is_ok_and(|names| names.is_empty()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run_with(root: &Path, files: &[&str]) -> PathBuf {
        let run = root.join("a");
        for file in files {
            let path = run.join(file);
            fs::create_dir_all(path.parent().expect("in the run")).expect("writable");
            fs::write(path, "old").expect("writable");
        }
        run
    }

    fn all(root: &Path) -> Vec<String> {
        let mut names: Vec<String> = names_in(root)
            .expect("readable")
            .into_iter()
            .map(|name| name.to_string_lossy().into_owned())
            .filter(|name| name != LOCK_FILE)
            .collect();
        names.sort();
        names
    }

    const FILES: [&str; 4] = ["experiment.ron", "run.json", "metrics.jsonl", "checkpoints/step-1/summary.json"];

    #[test]
    fn a_kill_at_any_place_leaves_one_whole_run() {
        // The run is moved file by file; then the new one is written: the experiment first.
        for moved in 0..=FILES.len() {
            for is_begun in [false, true] {
                let root = tempfile::tempdir().expect("a folder");
                let run = run_with(root.path(), &FILES);
                let aside = ReplacedRun::put_aside(&run).expect("movable");
                let folder = aside.folder.clone().expect("there was something");
                assert_eq!((run_of_leftover(&folder), run_of_leftover(&run)), (Some(run.clone()), None));
                match is_begun {
                    // Killed while the old run was moved, or after the first file of the new one.
                    false => {
                        for name in names_in(&folder).expect("readable").into_iter().take(moved) {
                            fs::rename(folder.join(&name), run.join(&name)).expect("movable");
                        }
                    }
                    true => {
                        fs::write(run.join("experiment.ron"), "new").expect("writable");
                        fs::write(run.join("run.json"), "new").expect("writable");
                    }
                }
                let was_whole = run.join("run.json").is_file() && !is_begun;
                if was_whole {
                    continue;
                }
                end_replacement(&run).expect("writable");
                assert_eq!(all(root.path()), ["a"], "{moved} {is_begun}");
                let text = fs::read_to_string(run.join("experiment.ron")).expect("there");
                assert_eq!(text, if is_begun { "new" } else { "old" });
                if !is_begun {
                    assert_eq!(all(&run), ["checkpoints", "experiment.ron", "metrics.jsonl", "run.json"]);
                }
            }
        }
    }

    #[test]
    fn a_folder_where_a_run_was_to_begin_is_free_whatever_a_kill_left_in_it() {
        let root = tempfile::tempdir().expect("a folder");
        let run =
            run_with(root.path(), &["run.lock", "cost.json", "cost.json.tmp7", "experiment.ron.tmp7", "run.json.tmp7"]);
        assert!(is_free(&run) && check_replaceable(&run).is_ok());
        fs::write(run.join("notes.txt"), "mine").expect("writable");
        assert!(!is_free(&run) && check_replaceable(&run).is_err());
    }

    #[test]
    fn what_another_process_replaces_is_left_to_it() {
        let root = tempfile::tempdir().expect("a folder");
        let run = run_with(root.path(), &FILES);
        let lock = RunLock::take(&run).expect("free");
        let aside = ReplacedRun::put_aside(&run).expect("movable");
        assert!(matches!(end_replacement(&run), Err(RunError::Busy(_))));
        drop(lock);
        aside.put_back();
        assert_eq!(all(root.path()), ["a"]);
    }
}
