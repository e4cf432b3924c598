//! Files that are whole or not there.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

/// Puts `bytes` at `path` so that a reader sees the old contents or the new, never a part: under a temporary name first,
/// flushed to the disk, then renamed.
///
/// # Errors
/// What the system says; the old contents are still there, and nothing else.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".tmp{}", std::process::id()));
    let temporary = path.with_file_name(name);
    let written = (|| {
        let mut file = File::create(&temporary)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        fs::rename(&temporary, path)
    })();
    if written.is_err() {
        // The first error is the one to report.
        let _ = fs::remove_file(&temporary);
        return written;
    }
    // Makes the new name durable where directories can be opened; elsewhere the rename is all there is.
    if let Some(Ok(folder)) = path.parent().map(File::open) {
        let _ = folder.sync_all();
    }
    Ok(())
}
