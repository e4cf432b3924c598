//! Threads for updates: rayon's workers, kept awake for short loops.

use rayon::{Yield, yield_now};
use std::{
    cell::Cell,
    sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering},
    time::{Duration, Instant},
};

/// Largest number of workers that stay awake: small networks have no work for more, and others wake up when there is.
const AWAKE: usize = 3;

/// Waiting time after which a worker goes back to sleep. Any other work that it has begun goes on then.
const PATIENCE: Duration = Duration::from_millis(20);

thread_local! {
    /// True if this thread does the work of an update, which must not wait for that of another.
    static WORKS: Cell<bool> = const { Cell::new(false) };
}

/// Number of updates that keep workers awake now.
static UPDATES: AtomicUsize = AtomicUsize::new(0);

/// Nanoseconds that workers have waited awake.
static WAITED: AtomicU64 = AtomicU64::new(0);

/// Runs the work on one of rayon's threads.
///
/// A parallel loop started outside rayon's pool puts its thread to sleep and wakes two, which takes as long as a
/// million products. Inside the pool it takes one call.
pub fn among_workers<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}

/// Runs the work as [`among_workers`] does, for many short loops. A few other workers wait for them awake, so that a
/// loop of some microseconds can be shared.
///
/// They yield to other work on their cores. [`waited`] returns how long they waited.
pub fn among_awake_workers<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let done = AtomicBool::new(false);
    rayon::scope(|scope| {
        let (first, done) = (rayon::current_thread_index().unwrap_or_default(), &done);
        let _until_the_end = Update::begin(done);
        scope.spawn_broadcast(move |_, worker| {
            let count = worker.num_threads();
            // The next ones after the one that does the work.
            let place = (worker.index() + count - first) % count;
            if (1..=AWAKE).contains(&place) && !WORKS.get() {
                wait_awake(done);
            }
        });
        work()
    })
}

/// Returns the time that workers have waited awake in this program so far, summed over workers. The system counts
/// them as busy.
pub fn waited() -> Duration {
    Duration::from_nanos(WAITED.load(Ordering::Relaxed))
}

/// Returns whether workers wait awake, so that even short loops can be shared.
pub fn are_awake() -> bool {
    UPDATES.load(Ordering::Relaxed) > 0
}

/// Keeps workers awake while it exists; a panic ends it, too.
struct Update<'a> {
    done: &'a AtomicBool,
    /// True if it is part of another.
    within: bool,
}

impl<'a> Update<'a> {
    fn begin(done: &'a AtomicBool) -> Self {
        UPDATES.fetch_add(1, Ordering::Relaxed);
        Self { done, within: WORKS.replace(true) }
    }
}

impl Drop for Update<'_> {
    fn drop(&mut self) {
        UPDATES.fetch_sub(1, Ordering::Relaxed);
        WORKS.set(self.within);
        self.done.store(true, Ordering::Release);
    }
}

fn wait_awake(done: &AtomicBool) {
    let (mut waited, mut since) = (Duration::ZERO, Instant::now());
    while !done.load(Ordering::Acquire) && since.elapsed() < PATIENCE {
        let start = Instant::now();
        if yield_now() == Some(Yield::Executed) {
            since = Instant::now();
        } else {
            std::thread::yield_now();
            waited += start.elapsed();
        }
    }
    WAITED.fetch_add(waited.as_nanos() as u64, Ordering::Relaxed);
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    /// Waits for the updates of other tests in this process.
    fn all_sleep_in_the_end() -> bool {
        (0..2000).any(|_| {
            std::thread::park_timeout(Duration::from_millis(5));
            !are_awake()
        })
    }

    #[test]
    fn work_is_done_and_workers_go_back_to_sleep() {
        let before = waited();
        let sum = among_awake_workers(|| {
            assert!(are_awake());
            std::thread::park_timeout(Duration::from_millis(50));
            (0..1000u64).into_par_iter().sum::<u64>()
        });
        assert_eq!(sum, 499_500);
        if rayon::current_num_threads() > 1 {
            assert!(waited() > before, "the others waited meanwhile");
        }
        assert!(all_sleep_in_the_end());
    }

    #[test]
    fn several_at_a_time_and_one_within_another_come_to_an_end() {
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..50 {
                        let inner = || (0..100u64).into_par_iter().map(|x| x * x).sum::<u64>();
                        assert_eq!(among_awake_workers(|| among_awake_workers(inner)), 328_350);
                    }
                });
            }
        });
    }

    #[test]
    fn a_panic_ends_it() {
        let result = std::panic::catch_unwind(|| among_awake_workers(|| panic!("stop")));
        assert!(result.is_err() && all_sleep_in_the_end());
    }
}
