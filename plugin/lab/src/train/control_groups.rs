//! What the control groups of the process leave it: a container has one around it.

use std::{fs, path::Path};

/// Something that control groups limit.
pub(super) struct Limited {
    /// Its name among the controllers of the first version.
    controller: &'static str,
    /// The files of a group that say the limit, and how much of it is used.
    files: [&'static str; 2],
    /// The same in the first version.
    older_files: [&'static str; 2],
}

/// Bytes of memory.
pub(super) const MEMORY: Limited = Limited {
    controller: "memory",
    files: ["memory.max", "memory.current"],
    older_files: ["memory.limit_in_bytes", "memory.usage_in_bytes"],
};

/// Threads.
pub(super) const THREADS: Limited =
    Limited { controller: "pids", files: ["pids.max", "pids.current"], older_files: ["pids.max", "pids.current"] };

/// What is left of it in the control group of the process and in those around it; `None` if no group limits it.
pub(super) fn left_in_groups(what: &Limited) -> Option<u64> {
    left(Path::new("/sys/fs/cgroup"), &fs::read_to_string("/proc/self/cgroup").ok()?, what)
}

/// Groups are named one to a line, as `0::/user/session`, and of the first version as `4:memory:/user`.
fn left(root: &Path, groups: &str, what: &Limited) -> Option<u64> {
    let left_for = |line: &str| -> Option<u64> {
        let mut parts = line.splitn(3, ':');
        let (_, kinds, path) = (parts.next()?, parts.next()?, parts.next()?);
        let (root, [limit, used]) = match kinds {
            "" => (root.to_owned(), what.files),
            kinds if kinds.split(',').any(|kind| kind == what.controller) => {
                (root.join(what.controller), what.older_files)
            }
            _ => return None,
        };
        let number = |file: &Path| -> Option<u64> { fs::read_to_string(file).ok()?.trim().parse().ok() };
        let folders = Path::new(path.trim_start_matches('/')).ancestors().map(|below| root.join(below));
        // A group without a limit says `max`, which is no number.
        let left =
            |group: &Path| Some(number(&group.join(limit))?.saturating_sub(number(&group.join(used)).unwrap_or(0)));
        folders.filter_map(|group| left(&group)).min()
    };
    groups.lines().filter_map(left_for).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_narrowest_group_counts() {
        let root = tempfile::tempdir().expect("a folder");
        let group = |path: &str, [limit, used]: [&str; 2], numbers: [&str; 2]| {
            let folder = root.path().join(path);
            fs::create_dir_all(&folder).expect("writable");
            fs::write(folder.join(limit), numbers[0]).expect("writable");
            fs::write(folder.join(used), numbers[1]).expect("writable");
        };
        group("a", MEMORY.files, ["1000\n", "400\n"]);
        group("a/b", MEMORY.files, ["max\n", "100\n"]);
        group("a/b", THREADS.files, ["50\n", "8\n"]);
        group("pids/c", THREADS.older_files, ["30\n", "31\n"]);
        let left = |groups: &str, what| left(root.path(), groups, what);
        assert_eq!((left("0::/a/b\n", &MEMORY), left("0::/a/b\n", &THREADS)), (Some(600), Some(42)));
        assert_eq!(left("0::/other\n1:cpu:/a\n", &MEMORY), None);
        assert_eq!(left("0::/a/b\n5:pids:/c\n", &THREADS), Some(0), "more is used than there is");
    }
}
