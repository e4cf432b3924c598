//! Looking for a run where there is none.

use std::{
    fs,
    path::{Path, PathBuf},
};

use bevy_playbot::unknown_name::nearest;

use super::{
    replaced_run::{is_being_replaced, is_free},
    run_error::RunError,
};

/// Files and folders of a run. One of them is enough: a run that lost the others is a damaged one.
const SIGNS: [&str; 4] = ["run.json", "experiment.ron", "metrics.jsonl", "checkpoints"];

/// Most runs that are named instead of one that is not there.
const NAMED: usize = 3;

/// Checks that a folder is that of a run, be it a damaged one.
///
/// # Errors
///
/// [`RunError::NoRun`] with the runs that may have been meant.
pub(super) fn check_is_run(path: &Path) -> Result<(), RunError> {
    if is_run(path) {
        return Ok(());
    }
    let advice = if path.is_dir() { of_folder(path) } else { of_nothing(path) };
    Err(RunError::NoRun { path: path.into(), advice })
}

fn is_run(path: &Path) -> bool {
    SIGNS.iter().any(|sign| path.join(sign).exists()) && !is_free(path)
}

/// What to say of a folder that is something else.
fn of_folder(path: &Path) -> String {
    let inside = runs_in(path);
    let shown: Vec<_> = inside.iter().take(NAMED).map(|run| run.display().to_string()).collect();
    let more = if inside.len() > NAMED { ", …" } else { "" };
    match inside.is_empty() {
        true if is_being_replaced(path) => {
            "it was to be replaced, which was stopped before the new run began; `playbot train --resume` there brings the \
             old one back"
                .to_owned()
        }
        true if is_free(path) => {
            format!(
                "the folder is there, but no training began in it; `playbot train --run {}` starts one",
                path.display()
            )
        }
        true => "the folder is there, but no training began in it; `playbot runs ls` lists runs".to_owned(),
        false => format!("it is a folder of runs: name one of them, such as {}{more}", shown.join(", ")),
    }
}

/// What to say where there is no folder.
fn of_nothing(path: &Path) -> String {
    let (what, begin) = match path.exists() {
        true => ("it is a file, and a run is a folder", "FOLDER".into()),
        false => ("there is no such folder", path.to_owned()),
    };
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let beside = runs_in(parent);
    let name_of = |run: &PathBuf| run.file_name().map(|name| name.to_string_lossy().into_owned());
    let names: Vec<String> = beside.iter().filter_map(name_of).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let wanted = path.file_name().unwrap_or_default().to_string_lossy();
    let near = nearest(&wanted, &names)
        .map_or_else(String::new, |name| format!(" (did you mean {}?)", path.with_file_name(name).display()));
    let ls = match (beside.is_empty(), parent == Path::new("runs")) {
        (true, _) => String::new(),
        (false, true) => "`playbot runs ls` lists those there are, and ".to_owned(),
        (false, false) => format!("`playbot runs ls {}` lists those there are, and ", parent.display()),
    };
    format!("{what}{near}; {ls}`playbot train --run {}` starts one", begin.display())
}

/// The runs directly in a folder, by name. A folder that cannot be listed has none to name.
fn runs_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut runs: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| is_run(path)).collect();
    runs.sort();
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_may_have_been_meant_is_said_and_no_file_of_ours_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path().join("runs");
        let error = |path: &Path| check_is_run(path).expect_err("no run").to_string();
        let alone = error(&root.join("none"));
        assert!(alone.contains("there is no such folder") && !alone.contains("runs ls"), "{alone}");
        for (run, file) in [("first", "run.json"), ("second", "experiment.ron")] {
            fs::create_dir_all(root.join(run)).expect("writable");
            fs::write(root.join(run).join(file), "").expect("writable");
            assert!(check_is_run(&root.join(run)).is_ok(), "{run}");
        }
        fs::create_dir_all(root.join("empty")).expect("writable");
        fs::write(root.join("file"), "").expect("writable");
        for (path, words) in [
            (root.join("fist"), "first?"),
            (root.join("none"), "lists those there are"),
            (root.join("empty"), "no training began in it; `playbot train --run "),
            (root.join("file"), "it is a file"),
            (root.join("file"), "`playbot train --run FOLDER` starts one"),
            (root.clone(), "name one of them"),
        ] {
            let text = error(&path);
            assert!(text.starts_with(&format!("no run at {}", path.display())), "{text}");
            assert!(text.contains(words) && !text.contains(".ron") && !text.contains(".json"), "{text}");
        }
    }
}
