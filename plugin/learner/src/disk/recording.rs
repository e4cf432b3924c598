//! Recording of disk operations, for tests.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::DiskOperation;

/// Number of active recordings. Without any, checking it is the only cost.
static ACTIVE: AtomicUsize = AtomicUsize::new(0);
static RECORDINGS: Mutex<Vec<Arc<Notes>>> = Mutex::new(Vec::new());

#[derive(Debug)]
struct Notes {
    folder: PathBuf,
    operations: Mutex<Vec<DiskOperation>>,
}

/// Records the operations of this process below a folder through [this module](super), until it is dropped. It is for
/// tests and changes nothing.
#[derive(Debug)]
pub struct DiskRecording(Arc<Notes>);

impl DiskRecording {
    /// Starts with the next operation whose path begins with that of `folder`.
    pub fn of(folder: &Path) -> Self {
        let notes = Arc::new(Notes { folder: folder.into(), operations: Mutex::default() });
        unpoisoned(&RECORDINGS).push(Arc::clone(&notes));
        ACTIVE.fetch_add(1, Ordering::Relaxed);
        Self(notes)
    }

    /// Returns the operations so far, in the order in which they were made.
    pub fn operations(&self) -> Vec<DiskOperation> {
        unpoisoned(&self.0.operations).clone()
    }
}

impl Drop for DiskRecording {
    fn drop(&mut self) {
        ACTIVE.fetch_sub(1, Ordering::Relaxed);
        unpoisoned(&RECORDINGS).retain(|notes| !Arc::ptr_eq(notes, &self.0));
    }
}

/// Returns whether any recording is active.
pub(super) fn is_recorded() -> bool {
    ACTIVE.load(Ordering::Relaxed) > 0
}

/// Adds an operation to all recordings; it is built only if there are any.
pub(super) fn note(operation: impl FnOnce() -> DiskOperation) {
    if !is_recorded() {
        return;
    }
    let operation = operation();
    for notes in unpoisoned(&RECORDINGS).iter().filter(|notes| operation.path().starts_with(&notes.folder)) {
        unpoisoned(&notes.operations).push(operation.clone());
    }
}

fn unpoisoned<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
