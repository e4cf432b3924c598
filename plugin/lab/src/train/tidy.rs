//! Clearing away what processes that were killed have left.

use std::path::Path;

use playbot_learner::disk;

use super::{checkpoint, run_lock::RunLock};

/// Removes what a process left that was killed while it wrote into a run: files under temporary names, and halves of
/// checkpoints. Nothing depends on whether that works, so that it is only said if it does not.
pub(super) fn tidy(lock: &RunLock) {
    remove_temporaries(lock.folder());
    if let Err(error) = checkpoint::remove_halves(lock.folder()) {
        tracing::warn!("{error}");
    }
}

/// Removes the files of a folder that were never finished, and names them. Only for who alone may write there.
pub(crate) fn remove_temporaries(folder: &Path) {
    match disk::remove_temporaries(folder) {
        Ok(files) => files.iter().for_each(|file| {
            tracing::warn!("{} was not finished by a process that was killed, and is removed", file.display());
        }),
        Err(error) => tracing::warn!("what was left unfinished in {} cannot be removed: {error}", folder.display()),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn what_was_left_is_gone_and_all_else_stays() {
        let run = tempfile::tempdir().expect("a folder");
        let file = |name: &str| {
            let path = run.path().join(name);
            fs::create_dir_all(path.parent().expect("in the run")).expect("writable");
            fs::write(&path, "half").expect("writable");
            path
        };
        let left = ["metrics.jsonl.tmp12", "checkpoints/unfinished/learner.safetensors.tmp12", "checkpoints/removed/a"];
        let kept =
            ["metrics.jsonl", "notes.tmp", "checkpoints/step-8/a", "checkpoints/damaged-step-16/a", "mine/a.tmp12"];
        let (left, kept) = (left.map(file), kept.map(file));
        tidy(&RunLock::take(run.path()).expect("free"));
        assert!(left.iter().all(|path| !path.exists()) && kept.iter().all(|path| path.exists()));
        assert!(
            !run.path().join("checkpoints/unfinished").exists() && !run.path().join("checkpoints/removed").exists()
        );
        tidy(&RunLock::take(run.path()).expect("free"));
    }
}
