//! Temporary names of unfinished files, and removal of the files that killed processes have left.

use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::remove_file;

/// Text between the name of a file and the number of the process that writes it.
const MARK: &str = ".tmp";

/// Returns the name under which this process writes a file before it is renamed, in the same folder.
pub fn temporary_name(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!("{MARK}{}", std::process::id()));
    path.with_file_name(name)
}

/// Returns whether this is the name of a file that some process has not finished writing.
fn is_temporary(name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    let Some((file, process)) = name.rsplit_once(MARK) else { return false };
    // A number alone, without a sign.
    !file.is_empty() && process.bytes().all(|byte| byte.is_ascii_digit()) && process.parse::<u32>().is_ok()
}

/// Removes unfinished files of killed processes from a folder, without its subfolders. Returns their names; a missing
/// folder has none.
///
/// Only for a caller that alone may write there: a process that still writes could not finish.
///
/// # Errors
/// The system's error.
pub fn remove_temporaries(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut left = Vec::new();
    for entry in entries {
        let entry = entry?;
        if is_temporary(&entry.file_name()) && entry.file_type()?.is_file() {
            left.push(entry.path());
        }
    }
    left.sort();
    left.iter().try_for_each(|file| remove_file(file))?;
    Ok(left)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_that_a_process_left_unfinished_are_removed() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        let own = temporary_name(&path("a.json"));
        let names = [
            "run.json.tmp1",
            "a.tmp.tmp4294967295",
            "a.tmp",
            "a.tmp-1",
            "a.tmp+1",
            "a.tmp1x",
            ".tmp7",
            "b.tmp4294967296",
        ];
        names.iter().for_each(|name| fs::write(path(name), "half").expect("writable"));
        fs::write(&own, "half").expect("writable");
        fs::create_dir(path("folder.tmp5")).expect("writable");
        fs::write(path("folder.tmp5/a.tmp6"), "below").expect("writable");
        let mut expected = vec![path(names[0]), path(names[1]), own];
        expected.sort();
        assert_eq!(remove_temporaries(folder.path()).expect("writable"), expected);
        assert!(expected.iter().all(|file| !file.exists()));
        assert!(names[2..].iter().all(|name| path(name).exists()) && path("folder.tmp5/a.tmp6").exists());
        assert_eq!(remove_temporaries(&path("none")).expect("nothing is there"), Vec::<PathBuf>::new());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_left_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let (file, link) = (folder.path().join("file"), folder.path().join("link.tmp8"));
        fs::write(&file, "somebody's").expect("writable");
        std::os::unix::fs::symlink(&file, &link).expect("writable");
        assert!(remove_temporaries(folder.path()).expect("readable").is_empty() && link.is_symlink());
    }
}
