//! Parallel work on a few threads.

use playbot_learner::Workers;
use std::{
    io,
    sync::{Mutex, PoisonError},
    thread,
    thread::Builder,
};

/// Runs `work` once for every item, on at most `threads` threads, and returns the results in the order of the items.
/// The networks that it computes take no others: where there are fewer items than threads, each item has its share.
///
/// Results do not depend on the distribution over threads, since each item is worked on alone. If the system starts
/// fewer threads, the work takes longer.
pub fn on_threads<T: Send, R: Send>(items: &mut [T], threads: usize, work: impl Fn(&mut T) -> R + Sync) -> Vec<R> {
    let started = threads.clamp(1, items.len().max(1));
    if started == 1 {
        return one_by_one(items, threads, work);
    }
    // The last threads may be left without items.
    let started = items.len().div_ceil(items.len().div_ceil(started));
    let each = |item: &mut T| Workers::new(threads / started).bound(|| work(item));
    share_out(items, started, Builder::new, &each)
}

/// Runs `work` once for every item on this thread, for items that are bound to it. The networks that it computes take
/// at most `threads` threads.
pub fn one_by_one<T, R>(items: &mut [T], threads: usize, work: impl Fn(&mut T) -> R) -> Vec<R> {
    Workers::here(threads).bound(|| items.iter_mut().map(work).collect())
}

fn share_out<T: Send, R: Send>(
    items: &mut [T],
    threads: usize,
    builder: impl Fn() -> Builder,
    work: &(impl Fn(&mut T) -> R + Sync),
) -> Vec<R> {
    let shares: Vec<Mutex<&mut [T]>> = items.chunks_mut(items.len().div_ceil(threads)).map(Mutex::new).collect();
    thread::scope(|scope| {
        let started: Vec<_> =
            shares.iter().map(|share| builder().spawn_scoped(scope, move || work_through(share, work))).collect();
        let parts = shares.iter().zip(started).flat_map(|(share, started)| match started {
            Ok(thread) => thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            // Works on this thread if the system starts no other.
            Err(_) => work_through(share, work),
        });
        parts.collect()
    })
}

/// Runs `work` once for every item, each on its own thread, for items that wait for one another. The networks that it
/// computes take no others.
///
/// # Errors
///
/// The system does not start enough threads. `give_up` is called for each item without a thread, which frees the
/// other items from waiting for it. Their results are lost.
pub fn on_own_threads<T: Send, R: Send>(
    items: &mut [T],
    work: impl Fn(&mut T) -> R + Sync,
    give_up: impl Fn(&mut T),
) -> io::Result<Vec<R>> {
    let each = |item: &mut T| Workers::new(1).bound(|| work(item));
    match items {
        // A single item has no other to wait for.
        [alone] => Ok(vec![each(alone)]),
        items => each_on_its_own(items, Builder::new, &each, &give_up),
    }
}

fn each_on_its_own<T: Send, R: Send>(
    items: &mut [T],
    builder: impl Fn() -> Builder,
    work: &(impl Fn(&mut T) -> R + Sync),
    give_up: &impl Fn(&mut T),
) -> io::Result<Vec<R>> {
    let shares: Vec<Mutex<&mut [T]>> = items.chunks_mut(1).map(Mutex::new).collect();
    thread::scope(|scope| {
        let started: Vec<_> =
            shares.iter().map(|share| builder().spawn_scoped(scope, move || work_through(share, work))).collect();
        for (share, _) in shares.iter().zip(&started).filter(|(_, started)| started.is_err()) {
            work_through(share, give_up);
        }
        let mut results = Vec::new();
        let mut refused = None;
        for started in started {
            match started {
                Ok(thread) => {
                    results.extend(thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
                }
                Err(error) => refused = Some(error),
            }
        }
        refused.map_or(Ok(results), Err)
    })
}

/// Works on the items of one thread.
fn work_through<T, R>(share: &Mutex<&mut [T]>, work: &impl Fn(&mut T) -> R) -> Vec<R> {
    share.lock().unwrap_or_else(PoisonError::into_inner).iter_mut().map(work).collect()
}

/// Returns the default number of threads: one per core.
pub fn default_threads() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

#[cfg(test)]
mod tests {
    use std::sync::Barrier;

    use super::*;

    /// Doubles a number, and returns the old one.
    fn double(number: &mut i32) -> i32 {
        *number *= 2;
        *number / 2
    }

    #[test]
    fn results_come_in_the_order_of_the_items_however_many_threads_there_are() {
        for threads in [0, 1, 2, 3, 100] {
            let mut numbers: Vec<i32> = (0..10).collect();
            assert_eq!(on_threads(&mut numbers, threads, double), (0..10).collect::<Vec<_>>());
            assert_eq!(numbers, (0..10).map(|number| 2 * number).collect::<Vec<_>>());
        }
        assert!(on_threads(&mut [], 3, double).is_empty());
    }

    #[test]
    fn items_with_threads_of_their_own_can_wait_for_one_another() {
        let barrier = Barrier::new(5);
        let meet = |number: &mut i32| {
            barrier.wait();
            double(number)
        };
        assert_eq!(on_own_threads(&mut [1, 2, 3, 4, 5], meet, |_| {}).expect("five threads"), [1, 2, 3, 4, 5]);
        assert_eq!(on_own_threads(&mut [7], double, |_| {}).expect("none"), [7]);
        assert!(on_own_threads(&mut [], double, |_| {}).expect("none").is_empty());
    }

    /// Makes threads with a stack larger than the address space.
    #[cfg(target_os = "linux")]
    fn impossible() -> Builder {
        Builder::new().stack_size(1 << 60)
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn where_no_thread_can_be_started_work_is_done_here_or_refused() {
        let mut numbers = [1, 2, 3, 4, 5];
        assert_eq!(share_out(&mut numbers, 2, impossible, &double), [1, 2, 3, 4, 5]);
        assert_eq!(numbers, [2, 4, 6, 8, 10]);
        let given_up = Mutex::new(Vec::new());
        let give_up = |number: &mut i32| given_up.lock().expect("no thread panics").push(*number);
        let error = each_on_its_own(&mut numbers, impossible, &double, &give_up).expect_err("no thread");
        assert!(!error.to_string().is_empty());
        assert_eq!(*given_up.lock().expect("no thread panics"), [2, 4, 6, 8, 10], "and nothing was done");
    }
}
