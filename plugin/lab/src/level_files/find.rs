//! Search for the files that match a pattern.

use std::path::Path;

use super::error::LevelFileError;

/// Largest number of files: a range cannot have more levels.
const MOST: usize = 1 << 24;

/// Returns the files that match a pattern, sorted by path: `*` stands for any name, `**` for any folders. Paths are
/// relative to the current folder of the program.
///
/// # Errors
///
/// The pattern is invalid, or no file matches.
pub fn find_level_files(pattern: &str) -> Result<Vec<String>, LevelFileError> {
    let found = glob::glob(pattern).map_err(|error| LevelFileError::Pattern {
        pattern: pattern.to_owned(),
        at: error.pos + 1,
        why: error.msg.to_owned(),
    })?;
    let mut paths = Vec::new();
    let mut folder = None;
    for entry in found {
        let path = entry.map_err(|error| LevelFileError::Unreadable {
            path: shown(error.path()),
            why: error.error().to_string(),
        })?;
        if path.is_dir() {
            folder.get_or_insert_with(|| shown(&path));
        } else {
            paths.push(shown(&path));
        }
        if paths.len() > MOST {
            return Err(LevelFileError::TooMany { pattern: pattern.to_owned() });
        }
    }
    if !paths.is_empty() {
        // The order of file systems differs.
        paths.sort_unstable();
        return Ok(paths);
    }
    Err(match folder {
        Some(path) => LevelFileError::Folder { path },
        None => {
            let folder = std::env::current_dir().map_or_else(|_| "here".to_owned(), |folder| shown(&folder));
            LevelFileError::NoFiles { pattern: pattern.to_owned(), folder }
        }
    })
}

/// Formats a path, equal on all systems.
fn shown(path: &Path) -> String {
    let text = path.to_string_lossy();
    if cfg!(windows) { text.replace('\\', "/") } else { text.into_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_in_the_order_of_their_paths_and_folders_are_none() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = glob::Pattern::escape(&shown(folder.path()));
        for file in ["b.json", "a/z.json", "a/c/y.json", "a.txt"] {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().expect("below the root")).expect("writable");
            std::fs::write(path, "{}").expect("writable");
        }
        std::fs::create_dir(folder.path().join("folder.json")).expect("writable");
        let names = |pattern: &str| -> Vec<String> {
            let found = find_level_files(&format!("{root}/{pattern}")).expect("files");
            let start = shown(folder.path()).len() + 1;
            found.iter().map(|path| path[start..].to_owned()).collect()
        };
        assert_eq!(names("**/*.json"), ["a/c/y.json", "a/z.json", "b.json"]);
        assert_eq!(names("*.json"), ["b.json"]);
        assert_eq!(names("a/z.json"), ["a/z.json"]);
        let error = |pattern: &str| find_level_files(&format!("{root}/{pattern}")).expect_err("no files");
        assert!(matches!(error("*.ron"), LevelFileError::NoFiles { .. }));
        let words = error("a").to_string();
        assert!(words.contains("is a folder") && words.contains("/a/**/*.json"), "{words}");
        assert!(matches!(find_level_files("a/***/b"), Err(LevelFileError::Pattern { .. })));
    }
}
