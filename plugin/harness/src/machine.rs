//! Memory and threads that the machine has left, and checks that something fits into them.
//!
//! The numbers are those of Linux: `/proc`, `ulimit` and control groups of the second version. Other systems have no
//! such numbers, and are taken to have enough.

use crate::{parallel::default_threads, worlds::Arrangement};
use playbot_learner::HasExitCode;
use std::{fs, path::Path, str::FromStr};
use thiserror::Error;

/// Largest number of Worlds, each of which plays on its own thread.
pub const MOST_WORLDS: u64 = 10_000;

/// Memory assumed to be free if the system does not report it.
const ASSUMED: u64 = 16 << 30;

/// Address space of a program besides the counted parts.
const BESIDE: u64 = 128 << 20;

/// Least bytes of a World without agents, with the used part of its thread's stack, and of an agent. The bundled
/// games take 1.4 MiB.
const WORLD: u64 = 1 << 20;

const ARENA: u64 = 1 << 10;

/// Address space of a thread's stack, the default of the standard library, and that of the heap that the C library
/// sets aside for a thread while it can.
const STACK: u64 = 2 << 20;

const HEAP: u64 = 64 << 20;

/// Threads of a program beside the compute threads: the main thread, signal listeners and the progress display.
const OTHERS: u64 = 5;

/// Data that needs more memory than the machine has left.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{what} need {}, and {} of memory are free: lower {keys}", amount(*needed), amount(*free))]
pub struct MemoryError {
    /// The data, with the factors of its size.
    pub what: String,
    /// Needed bytes.
    pub needed: u64,
    /// Free bytes.
    pub free: u64,
    /// The keys or options to lower, each between backticks.
    pub keys: String,
}

impl HasExitCode for MemoryError {}

/// Formats bytes in a readable unit.
fn amount(bytes: u64) -> String {
    let (unit, name) = if bytes < 1 << 30 { (1 << 20, "MiB") } else { (1 << 30, "GiB") };
    format!("{:.1} {name}", bytes as f64 / f64::from(unit))
}

/// A part of the memory that a program needs.
#[derive(Clone, Debug)]
pub struct MemoryPart {
    /// Description, with the factors of its size.
    pub what: String,
    /// Its size.
    pub bytes: u64,
    /// The keys or options to lower.
    pub keys: String,
}

impl MemoryPart {
    /// Returns the part of Worlds with their arenas.
    pub fn of_worlds(arrangement: Arrangement) -> Self {
        let (worlds, arenas) = (u64::from(arrangement.worlds), u64::from(arrangement.total()));
        Self {
            what: format!("{worlds} Worlds with {arenas} arenas"),
            bytes: product(&[worlds, WORLD]).saturating_add(product(&[arenas, ARENA])),
            keys: "`worlds`, `arenas`".to_owned(),
        }
    }
}

/// Checks that all parts together fit into so many free bytes. The error names the largest part.
///
/// # Errors
///
/// [`MemoryError`].
pub fn check_parts(parts: &[MemoryPart], free: u64) -> Result<(), MemoryError> {
    let needed = parts.iter().fold(0u64, |sum, part| sum.saturating_add(part.bytes));
    match parts.iter().max_by_key(|part| part.bytes) {
        Some(MemoryPart { what, bytes, keys }) if needed > free => Err(if *bytes > free {
            MemoryError { what: what.clone(), needed: *bytes, free, keys: keys.clone() }
        } else {
            MemoryError { what: format!("{what}, and what else is kept,"), needed, free, keys: keys.clone() }
        }),
        _ => Ok(()),
    }
}

/// Checks that bytes of `what` fit into the free memory, beside the Worlds that fill them.
///
/// # Errors
///
/// [`MemoryError`] with the keys to lower.
pub fn check_bytes(what: String, bytes: u64, keys: &str, worlds: Arrangement) -> Result<(), MemoryError> {
    let part = MemoryPart { what, bytes, keys: keys.to_owned() };
    check_parts(&[part, MemoryPart::of_worlds(worlds)], free_memory())
}

/// Returns a product, or the largest number if it overflows.
pub fn product(factors: &[u64]) -> u64 {
    factors.iter().fold(1, |product, factor| product.saturating_mul(*factor))
}

/// Returns the free bytes for counted data: the least that the machine, the control groups of the program and
/// `ulimit -v` leave. A fixed number would limit a large machine, or let a small one thrash.
pub fn free_memory() -> u64 {
    let available = text("/proc/meminfo").and_then(|text| kib(&text, "MemAvailable:")).unwrap_or(ASSUMED);
    available.min(left_in_groups(MEMORY).unwrap_or(u64::MAX)).min(free_space())
}

/// Returns the free bytes of address space under `ulimit -v` for counted data.
fn free_space() -> u64 {
    let taken = || text("/proc/self/status").and_then(|text| kib(&text, "VmSize:")).unwrap_or(0);
    soft_limit("Max address space").map_or(u64::MAX, |limit| limit.saturating_sub(taken()).saturating_sub(BESIDE))
}

/// A limit on threads.
#[derive(Clone, Copy, Debug)]
pub struct ThreadLimit {
    /// Number of threads that may be started.
    pub most: u64,
    /// Source of the limit.
    pub whose: &'static str,
}

impl ThreadLimit {
    /// Returns the narrowest limit on threads beside those that the program always has.
    pub fn now() -> Self {
        let own = (default_threads() as u64).saturating_add(OTHERS);
        let beside_own = |most: u64| most.saturating_sub(own);
        let limits = [
            (limit_of_user().map(beside_own), "`ulimit -u`"),
            (left_in_groups(THREADS).map(beside_own), "the control group of the program (pids.max)"),
            (Some(beside_own(free_space() / STACK)), "`ulimit -v`"),
        ];
        let limits = limits.into_iter().filter_map(|(most, whose)| Some(Self { most: most?, whose }));
        let own_limit = Self { most: MOST_WORLDS, whose: "this program" };
        limits.filter(|limit| limit.most < MOST_WORLDS).min_by_key(|limit| limit.most).unwrap_or(own_limit)
    }
}

/// Returns the limit of `ulimit -u`, which does not apply to root.
fn limit_of_user() -> Option<u64> {
    let user: Option<u32> = text("/proc/self/status").and_then(|text| word(&text, "Uid:"));
    if user == Some(0) { None } else { soft_limit("Max processes") }
}

/// Returns as many of the wanted threads as the limits on threads and on address space leave room for, but at least
/// one. Results must not depend on this number.
pub fn usable_threads(wanted: usize) -> usize {
    usable_within(wanted, ThreadLimit::now().most, free_space())
}

fn usable_within(wanted: usize, most: u64, space: u64) -> usize {
    (wanted as u64).min(most).min(space / (STACK + HEAP)).max(1) as usize
}

/// Files of a control group with the limit on a resource and its present use.
type Limited = [&'static str; 2];

const MEMORY: Limited = ["memory.max", "memory.current"];

const THREADS: Limited = ["pids.max", "pids.current"];

/// Returns the unused amount in the control group of the process and in all groups around it; `None` if no group
/// limits it.
fn left_in_groups(files: Limited) -> Option<u64> {
    left_below(Path::new("/sys/fs/cgroup"), &text("/proc/self/cgroup")?, files)
}

/// The group is named in a line such as `0::/user/session`.
fn left_below(root: &Path, groups: &str, [limit, used]: Limited) -> Option<u64> {
    let path = groups.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let number = |file: &Path| -> Option<u64> { fs::read_to_string(file).ok()?.trim().parse().ok() };
    // A group without a limit has the text `max`.
    let left = |group: &Path| Some(number(&group.join(limit))?.saturating_sub(number(&group.join(used)).unwrap_or(0)));
    Path::new(path).ancestors().filter_map(|group| left(&root.join(group))).min()
}

/// Returns the text of a file such as `/proc/meminfo`.
fn text(path: &str) -> Option<String> {
    fs::read_to_string(path).ok()
}

/// Returns the word after the name of a line such as `Threads:   6`, or `VmSize:   1234 kB`.
fn word<T: FromStr>(text: &str, name: &str) -> Option<T> {
    text.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next()?.parse().ok()
}

/// Returns the kibibytes of such a line, in bytes.
fn kib(text: &str, name: &str) -> Option<u64> {
    word::<u64>(text, name)?.checked_mul(1024)
}

/// Returns the limit that `ulimit` sets, for instance on `Max address space`; `None` without a limit.
fn soft_limit(name: &str) -> Option<u64> {
    word(&text("/proc/self/limits")?, name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_has_some_memory_and_some_threads() {
        assert!((1 << 20..1 << 60).contains(&free_memory()), "{}", free_memory());
        let ThreadLimit { most, whose } = ThreadLimit::now();
        assert!((1..=MOST_WORLDS).contains(&most), "{most} by {whose}");
        assert_eq!(usable_threads(1), 1);
    }

    #[test]
    fn parts_are_added_up_and_the_largest_is_named() {
        let part = |what: &str, bytes| MemoryPart { what: what.to_owned(), bytes, keys: format!("`{what}`") };
        let parts = [part("a", 3 << 20), part("b", 2 << 20)];
        assert_eq!(check_parts(&parts, 5 << 20), Ok(()));
        let words = |free| check_parts(&parts, free).expect_err("too large").to_string();
        assert_eq!(words(4 << 20), "a, and what else is kept, need 5.0 MiB, and 4.0 MiB of memory are free: lower `a`");
        assert_eq!(words(2 << 20), "a need 3.0 MiB, and 2.0 MiB of memory are free: lower `a`");
    }

    #[test]
    fn limits_leave_fewer_threads_than_are_wanted_but_always_one() {
        const EACH: u64 = STACK + HEAP;
        for (wanted, most, space, usable) in [
            (8, 100, u64::MAX, 8),
            (8, 3, u64::MAX, 3),
            (8, 0, u64::MAX, 1),
            (8, 100, 5 * EACH, 5),
            (8, 100, EACH - 1, 1),
            (0, 100, u64::MAX, 1),
            (usize::MAX, MOST_WORLDS, 6 * EACH, 6),
        ] {
            assert_eq!(usable_within(wanted, most, space), usable, "{wanted} of at most {most} in {space} bytes");
        }
    }

    #[test]
    fn the_narrowest_control_group_counts() {
        let root = tempfile::tempdir().expect("a folder");
        let group = |path: &str, [limit, used]: Limited, numbers: [&str; 2]| {
            let folder = root.path().join(path);
            fs::create_dir_all(&folder).expect("writable");
            fs::write(folder.join(limit), numbers[0]).expect("writable");
            fs::write(folder.join(used), numbers[1]).expect("writable");
        };
        group("a", MEMORY, ["1000\n", "400\n"]);
        group("a/b", MEMORY, ["max\n", "100\n"]);
        group("a/b", THREADS, ["50\n", "8\n"]);
        group("c", THREADS, ["30\n", "31\n"]);
        let left = |groups: &str, files| left_below(root.path(), groups, files);
        assert_eq!((left("0::/a/b\n", MEMORY), left("0::/a/b\n", THREADS)), (Some(600), Some(42)));
        assert_eq!(left("1:cpu:/a\n0::/other\n", MEMORY), None);
        assert_eq!(left("0::/c\n", THREADS), Some(0), "more is used than there is");
    }

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
