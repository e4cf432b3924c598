//! How many threads share work that any number of them can do.

use super::{
    free_memory::{free_of, space_left},
    free_threads::free_threads,
    thread_space::Threads,
};

/// As many of the threads that are wanted as the limits on threads and on address space leave room for, but at least the one
/// that asks. What is worked out must not depend on their number.
pub fn usable_threads(wanted: usize) -> usize {
    within(wanted, free_threads().most, free_of(u64::MAX, space_left()), Threads::now())
}

fn within(wanted: usize, most: u64, space: u64, threads: Threads) -> usize {
    let fits = |count: &u64| threads.space(*count) <= space;
    (2..=most.min(wanted as u64)).rev().find(fits).unwrap_or(1) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_leave_fewer_threads_than_are_wanted_but_always_one() {
        let now = Threads::now();
        for (wanted, most, space, usable) in [
            (8, 100, u64::MAX, 8),
            (8, 3, u64::MAX, 3),
            (8, 0, u64::MAX, 1),
            (8, 100, now.space(5), 5),
            (8, 100, now.space(2) - 1, 1),
            (0, 100, u64::MAX, 1),
            (usize::MAX, 10_000, now.space(6), 6),
        ] {
            assert_eq!(within(wanted, most, space, now), usable, "{wanted} of at most {most} in {space} bytes");
        }
        assert_eq!(usable_threads(1), 1);
    }
}
