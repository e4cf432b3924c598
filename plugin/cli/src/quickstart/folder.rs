//! The folder of a quickstart.

use std::path::Path;

use playbot_lab::train::{
    Algorithm,
    run_dir::{check_replaceable, is_unstarted},
    run_lock::RunLock,
};
use playbot_learner::disk;

use crate::error::CliError;

/// Checks that a folder is new or of an earlier quickstart, and not in use.
///
/// # Errors
///
/// It holds something else, or is in use.
pub(super) fn check_folder(path: &Path) -> Result<(), CliError> {
    let is_run = path.join("run.json").exists();
    let was_ours = RunLock::is_known(path) || path.join(Algorithm::ScorePpo.name()).join("run.json").is_file();
    if path.exists() && !is_unstarted(path) && (is_run || !was_ours) {
        return Err(CliError::Usage(format!(
            "{} is not the folder of a quickstart, so it is left alone: choose another --run",
            path.display()
        )));
    }
    if RunLock::is_known(path) {
        RunLock::take(path)?;
    }
    for run in [Algorithm::ScorePpo, Algorithm::Ppo].map(|algorithm| path.join(algorithm.name())) {
        if run.exists() {
            // Checked before skills are learned.
            check_replaceable(&run)?;
            RunLock::take(&run)?;
        }
    }
    Ok(())
}

/// Makes the folder of the quickstart and locks it.
///
/// # Errors
///
/// The system refuses, or it is in use.
pub(super) fn take_folder(path: &Path) -> Result<RunLock, CliError> {
    disk::create_dir_all(path).map_err(|error| CliError::Io(format!("cannot create {}: {error}", path.display())))?;
    Ok(RunLock::take(path)?)
}
