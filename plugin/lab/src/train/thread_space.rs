//! Address space that threads take, which `ulimit -v` limits: far more than the memory that they use.

use super::proc_files::{text, word};
use crate::parallel::default_threads;

/// The stack of a thread, as the standard library makes it.
const STACK: u64 = 2 << 20;

/// What glibc sets aside for each of its heaps. Every thread gets one of its own, as long as there are fewer of them than
/// [`HEAPS_PER_CORE`] for each core, whatever share of those a container leaves.
const HEAP: u64 = if cfg!(target_env = "gnu") { 64 << 20 } else { 0 };
const HEAPS_PER_CORE: u64 = 8;

/// What work takes beside what is counted, whatever it is: images, tables, and room in heaps that nothing fits into.
const ANY_WORK: u64 = 64 << 20;

/// Threads of a program beside those that compute, one for each core: its first one, and those that listen for signals and
/// show how far work is.
const OTHERS: u64 = 5;

/// Threads of the process that there are, and that there will be whatever it does.
#[derive(Clone, Copy, Debug)]
pub(super) struct Threads {
    /// Those that compute.
    cores: u64,
    /// Heaps that there are at most.
    heaps: u64,
    running: u64,
}

impl Threads {
    /// Those of this process.
    pub(super) fn now() -> Self {
        let status = text("/proc/self/status").unwrap_or_default();
        let cores = default_threads() as u64;
        let heaps = allowed_cores(&status).unwrap_or(cores).saturating_mul(HEAPS_PER_CORE);
        Self { cores, heaps, running: word(&status, "Threads:").unwrap_or(1) }
    }

    /// How many will come beside those that Worlds play on.
    pub(super) fn coming(self) -> u64 {
        self.cores.saturating_add(OTHERS).saturating_sub(self.running)
    }

    /// Bytes of address space that those will take, and one for each World, with what any work takes.
    pub(super) fn space(self, worlds: u64) -> u64 {
        let threads = self.coming().saturating_add(worlds);
        let heaps = self.heaps.saturating_sub(self.running);
        let stacks = threads.saturating_mul(STACK);
        stacks.saturating_add(threads.min(heaps).saturating_mul(HEAP)).saturating_add(ANY_WORK)
    }
}

/// Cores that the line `Cpus_allowed:   ff,ffffffff` has a bit for.
fn allowed_cores(status: &str) -> Option<u64> {
    let mask: String = word(status, "Cpus_allowed:")?;
    Some(mask.chars().filter_map(|digit| digit.to_digit(16)).map(|digit| u64::from(digit.count_ones())).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_thread_has_a_stack_and_a_heap_of_its_own_as_long_as_there_are_any() {
        let new = Threads { cores: 2, heaps: 16, running: 1 };
        assert_eq!(new.coming(), 6);
        assert_eq!(new.space(0), 6 * (STACK + HEAP) + ANY_WORK);
        assert_eq!(new.space(9), 15 * (STACK + HEAP) + ANY_WORK);
        let most = 106 * STACK + 15 * HEAP + ANY_WORK;
        assert_eq!(new.space(100), most, "two cores have 16 heaps, of which one is there");
        assert_eq!(new.space(u64::MAX), u64::MAX);
        assert_eq!(allowed_cores("Threads:\t6\nCpus_allowed:\t7,0000000f\nCpus_allowed_list:\t0-3\n"), Some(7));
        let busy = Threads { cores: 2, heaps: 16, running: 40 };
        assert_eq!((busy.coming(), busy.space(3)), (0, 3 * STACK + ANY_WORK));
    }
}
