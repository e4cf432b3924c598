//! How much memory a program may still take: the least of what the machine, its containers and `ulimit -v` leave.

use super::{
    control_groups::{MEMORY, left_in_groups},
    proc_files::{kib, soft_limit, text},
};

/// What a training may take where the system does not say how much is free.
const USUAL: u64 = 16 << 30;

/// Address space that any program takes besides what is counted.
const BESIDE: u64 = 128 << 20;

/// Bytes that are free. A number of our own would refuse what a large machine can do, or let a small one thrash.
pub(crate) fn free_memory() -> u64 {
    free_of(memory_left(), space_left())
}

/// Bytes for what is kept, of so many bytes of memory and of address space.
pub(super) fn free_of(memory: u64, space: u64) -> u64 {
    memory.min(space.saturating_sub(BESIDE))
}

/// Bytes of memory that the machine and its containers leave.
pub(super) fn memory_left() -> u64 {
    let available = text("/proc/meminfo").and_then(|text| kib(&text, "MemAvailable:")).unwrap_or(USUAL);
    available.min(left_in_groups(&MEMORY).unwrap_or(u64::MAX))
}

/// Bytes of address space that `ulimit -v` leaves, for what is kept and for threads.
pub(super) fn space_left() -> u64 {
    let taken = || text("/proc/self/status").and_then(|text| kib(&text, "VmSize:")).unwrap_or(0);
    soft_limit("Max address space").map_or(u64::MAX, |limit| limit.saturating_sub(taken()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_has_some_memory() {
        assert!(free_memory() > 1 << 20 && memory_left() < 1 << 60, "{}", free_memory());
        assert!(space_left() > 1 << 20);
    }
}
