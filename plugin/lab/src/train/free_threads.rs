//! How many threads a program may still start: the least of what the kernel, `ulimit -u` and its containers leave.

use super::{
    control_groups::{THREADS, left_in_groups},
    proc_files::{number, soft_limit, text, word},
    thread_space::Threads,
};

/// More Worlds than anybody has a use for: each plays on a thread of its own.
pub(super) const MOST_WORLDS: u64 = 10_000;

/// Mappings of memory that a thread needs: its stack, and the page behind it that guards it.
const MAPPINGS: u64 = 2;

/// A limit on threads.
#[derive(Clone, Copy, Debug)]
pub(super) struct ThreadLimit {
    /// Threads that may be started.
    pub most: u64,
    /// Who says so.
    pub whose: &'static str,
}

/// Threads that may be started beside those that a program has whatever it does.
pub(super) fn free_threads() -> ThreadLimit {
    let of_system = |most: &str| number(most).map(|most| most.saturating_sub(tasks()));
    let limits = [
        (Some(MOST_WORLDS), "this program"),
        (of_system("/proc/sys/kernel/threads-max"), "the kernel (/proc/sys/kernel/threads-max)"),
        (of_system("/proc/sys/kernel/pid_max"), "the kernel (/proc/sys/kernel/pid_max)"),
        (left_of_mappings(), "the kernel (/proc/sys/vm/max_map_count)"),
        (limit_of_user(), "`ulimit -u`"),
        (left_in_groups(&THREADS), "the control group of the program (pids.max)"),
    ];
    let limits = limits.into_iter().filter_map(|(most, whose)| Some(ThreadLimit { most: most?, whose }));
    let least =
        limits.min_by_key(|limit| limit.most).unwrap_or(ThreadLimit { most: MOST_WORLDS, whose: "this program" });
    ThreadLimit { most: least.most.saturating_sub(Threads::now().coming()), ..least }
}

/// Threads of all programs on the machine, which the line `0.00 0.01 0.05 1/234 5678` has behind its stroke.
fn tasks() -> u64 {
    let count = |text: &str| -> Option<u64> { text.split_whitespace().nth(3)?.split_once('/')?.1.parse().ok() };
    text("/proc/loadavg").and_then(|text| count(&text)).unwrap_or(0)
}

/// Threads for whose stacks there are mappings left.
fn left_of_mappings() -> Option<u64> {
    let there = text("/proc/self/maps").map_or(0, |maps| maps.lines().count() as u64);
    Some(number("/proc/sys/vm/max_map_count")?.saturating_sub(there) / MAPPINGS)
}

/// What `ulimit -u` says; it does not hold for root.
fn limit_of_user() -> Option<u64> {
    let user: Option<u32> = text("/proc/self/status").and_then(|text| word(&text, "Uid:"));
    if user == Some(0) { None } else { soft_limit("Max processes") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_has_some_threads_and_not_any_number() {
        let ThreadLimit { most, whose } = free_threads();
        assert!((1..=MOST_WORLDS).contains(&most), "{most} by {whose}");
    }
}
