//! Files that a training has written into its folder.

use std::{fs, path::Path};

/// Returns the number of logged updates.
pub fn logged(run: &Path) -> usize {
    fs::read_to_string(run.join("metrics.jsonl")).unwrap_or_default().lines().count()
}

/// Returns the names of its checkpoints, in order.
pub fn steps(run: &Path) -> Vec<String> {
    let entries = fs::read_dir(run.join("checkpoints")).expect("a run");
    let names = entries.map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned());
    let mut names: Vec<_> = names.filter(|name| name.starts_with("step-")).collect();
    names.sort();
    names
}

/// Its metrics, and weights and arenas of the last checkpoint.
pub fn results(run: &Path) -> [Vec<u8>; 3] {
    let last = run.join("checkpoints").join(steps(run).pop().expect("a checkpoint"));
    [run.join("metrics.jsonl"), last.join("learner.safetensors"), last.join("arenas.json")]
        .map(|path| fs::read(path).expect("readable"))
}
