//! How much memory a program may still take: the least of what the machine, its containers and `ulimit -v` leave.

use std::{fs, path::Path};

/// What a training may take where the system does not say how much is free.
const USUAL: u64 = 16 << 30;

/// Address space that threads and their stacks take besides what is counted.
const THREADS: u64 = 128 << 20;

/// Bytes that are free. A number of our own would refuse what a large machine can do, or let a small one thrash.
pub(crate) fn free_memory() -> u64 {
    let read = |path: &str| fs::read_to_string(path).ok();
    let available = read("/proc/meminfo").and_then(|text| line_kib(&text, "MemAvailable:")).unwrap_or(USUAL);
    let of_groups =
        read("/proc/self/cgroup").map_or(u64::MAX, |text| left_in_groups(Path::new("/sys/fs/cgroup"), &text));
    let space = read("/proc/self/limits").and_then(|text| address_space(&text)).unwrap_or(u64::MAX);
    let taken = read("/proc/self/status").and_then(|text| line_kib(&text, "VmSize:")).unwrap_or(0);
    available.min(of_groups).min(space.saturating_sub(taken).saturating_sub(THREADS))
}

/// Bytes in a line such as `MemAvailable:   123456 kB`.
fn line_kib(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kib.checked_mul(1024)
}

/// The limit in the line `Max address space   SOFT   HARD   bytes`, which is what `ulimit -v` sets.
fn address_space(limits: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// What is left in the control group of the process and in those around it. Groups are named one to a line, as
/// `0::/user/session`, and of the first version as `4:memory:/user`.
fn left_in_groups(root: &Path, groups: &str) -> u64 {
    let left = |line: &str| -> Option<u64> {
        let mut parts = line.splitn(3, ':');
        let (_, kinds, path) = (parts.next()?, parts.next()?, parts.next()?);
        let (root, limit, used) = match kinds {
            "" => (root.to_owned(), "memory.max", "memory.current"),
            kinds if kinds.split(',').any(|kind| kind == "memory") => {
                (root.join("memory"), "memory.limit_in_bytes", "memory.usage_in_bytes")
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
    groups.lines().filter_map(left).min().unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_says_what_is_available() {
        let text = "MemTotal:       16384000 kB\nMemFree:          100 kB\nMemAvailable:    2048 kB\n";
        let available = |text| line_kib(text, "MemAvailable:");
        assert_eq!((available(text), available("MemFree: 3 kB")), (Some(2 << 20), None));
        let limits = "Limit    Soft Limit   Hard Limit   Units\nMax address space         409600000            unlimited   bytes\n";
        assert_eq!(
            (address_space(limits), address_space(&limits.replace("409600000", "unlimited"))),
            (Some(409_600_000), None)
        );
    }

    #[test]
    fn the_narrowest_group_counts() {
        let root = tempfile::tempdir().expect("a folder");
        let group = |path: &str, limit: &str, used: &str| {
            let folder = root.path().join(path);
            fs::create_dir_all(&folder).expect("writable");
            fs::write(folder.join("memory.max"), limit).expect("writable");
            fs::write(folder.join("memory.current"), used).expect("writable");
        };
        group("a", "1000\n", "400\n");
        group("a/b", "max\n", "100\n");
        assert_eq!(left_in_groups(root.path(), "0::/a/b\n"), 600);
        assert_eq!(left_in_groups(root.path(), "0::/other\n1:cpu:/a\n"), u64::MAX);
    }
}
