//! Numbers that Linux tells of itself and of the process. Elsewhere there are none.

use std::{fs, str::FromStr};

/// The text of a file such as `/proc/meminfo`.
pub(super) fn text(path: &str) -> Option<String> {
    fs::read_to_string(path).ok()
}

/// A file that is a number.
pub(super) fn number(path: &str) -> Option<u64> {
    text(path)?.trim().parse().ok()
}

/// The word behind the name of a line such as `Threads:   6`, or `VmSize:   1234 kB`.
pub(super) fn word<T: FromStr>(text: &str, name: &str) -> Option<T> {
    text.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next()?.parse().ok()
}

/// The kibibytes of such a line, in bytes.
pub(super) fn kib(text: &str, name: &str) -> Option<u64> {
    word::<u64>(text, name)?.checked_mul(1024)
}

/// What a program may take of something that `ulimit` limits, such as `Max address space`; `None` if that has no limit.
pub(super) fn soft_limit(name: &str) -> Option<u64> {
    word(&text("/proc/self/limits")?, name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_found_by_their_names() {
        let text = "MemTotal:       16384000 kB\nMemFree:          100 kB\nMemAvailable:    2048 kB\n";
        assert_eq!((kib(text, "MemAvailable:"), kib(text, "MemFree: 3 kB")), (Some(2 << 20), None));
        let limits = "Limit    Soft Limit   Hard Limit   Units\nMax address space         409600000            unlimited   bytes\n";
        assert_eq!(word(limits, "Max address space"), Some(409_600_000_u64));
        assert_eq!(word::<u64>(&limits.replace("409600000", "unlimited"), "Max address space"), None);
        assert_eq!(word("Uid:\t0\t7\t0\t0\n", "Uid:"), Some(0_u32), "the first of several");
    }
}
