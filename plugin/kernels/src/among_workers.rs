//! Threads for loops: as many as the caller allows, kept awake while an update has short loops.

use rayon::{ThreadPool, ThreadPoolBuilder, Yield, yield_now};
use std::{
    cell::{Cell, RefCell},
    hint::spin_loop,
    sync::{
        Arc, Mutex, OnceLock, PoisonError,
        atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering},
    },
    thread::LocalKey,
    time::{Duration, Instant},
};

/// Waiting time after which a worker goes back to sleep. Any other work that it has begun goes on then.
const PATIENCE: Duration = Duration::from_millis(20);

/// Pauses of a waiting worker between two looks. They leave a core's other thread its arithmetic.
const PAUSES: usize = 16;

/// Looks after which a waiting worker also searches for work of the pool that no loop has announced.
const UNANNOUNCED: u64 = 16;

/// Looks after which the thread that began a loop sleeps until the others have done their pieces.
const LOOKS: u32 = 1000;

thread_local! {
    /// The threads that loops of this thread may take; those of its pool, or of rayon's global one, without a number.
    static WORKERS: RefCell<Option<Workers>> = const { RefCell::new(None) };

    /// The update that this thread works for, whose workers wait awake.
    static TEAM: RefCell<Option<Arc<Team>>> = const { RefCell::new(None) };

    /// True if this thread does the work of an update, which must not wait for that of another.
    static WORKS: Cell<bool> = const { Cell::new(false) };

    /// Time that this thread has spent in loops with others.
    static SHARED: Cell<Duration> = const { Cell::new(Duration::ZERO) };

    /// True in such a loop. Loops within it are part of it.
    static SHARES: Cell<bool> = const { Cell::new(false) };
}

/// Nanoseconds that workers have waited awake.
static WAITED: AtomicU64 = AtomicU64::new(0);

/// A number of threads that loops may take. Without one they take those of rayon's global pool, one for each core.
///
/// ```
/// use playbot_kernels::{among_workers::Workers, kept_memory::share};
///
/// let mut squares = vec![0; 1000];
/// Workers::new(2).bound(|| share(&mut squares, 10, usize::MAX, |piece, numbers| {
///     numbers.iter_mut().enumerate().for_each(|(i, number)| *number = (10 * piece + i).pow(2));
/// }));
/// assert_eq!(squares[999], 998_001);
/// ```
#[derive(Clone, Debug)]
pub struct Workers(Arc<Crew>);

#[derive(Debug)]
struct Crew {
    threads: usize,
    /// Started by the first loop that is worth it; `None` for a single thread, or if the system starts none.
    pool: OnceLock<Option<ThreadPool>>,
}

impl Workers {
    /// Allows so many threads, at least one. None is started yet.
    pub fn new(threads: usize) -> Self {
        Self(Arc::new(Crew { threads: threads.max(1), pool: OnceLock::new() }))
    }

    /// Returns those that this thread has, if they are so many, with the threads that they have started.
    pub fn here(threads: usize) -> Self {
        let here = WORKERS.with_borrow(Clone::clone);
        here.filter(|workers| workers.0.threads == threads.max(1)).unwrap_or_else(|| Self::new(threads))
    }

    /// Runs the work on this thread, with loops that take at most so many threads. One thread is this one. More are
    /// those of a pool of their own, for which this one waits.
    pub fn bound<T>(&self, work: impl FnOnce() -> T) -> T {
        let _until_the_end = Restore::after(&WORKERS, Some(self.clone()));
        work()
    }

    fn pool(&self) -> Option<&ThreadPool> {
        let Crew { threads, pool } = &*self.0;
        let start = || ThreadPoolBuilder::new().num_threads(*threads).thread_name(|i| format!("worker {i}")).build();
        pool.get_or_init(|| if *threads > 1 { start().ok() } else { None }).as_ref()
    }
}

/// Sets a thread's variable back when it is dropped.
pub(crate) struct Restore<T: Default + 'static> {
    of: &'static LocalKey<RefCell<T>>,
    before: T,
}

impl<T: Default + 'static> Restore<T> {
    /// Sets the variable until then.
    pub(crate) fn after(of: &'static LocalKey<RefCell<T>>, value: T) -> Self {
        Self { of, before: of.replace(value) }
    }
}

impl<T: Default + 'static> Drop for Restore<T> {
    fn drop(&mut self) {
        self.of.set(std::mem::take(&mut self.before));
    }
}

/// Sets a thread's flag until it is dropped.
struct Flag {
    of: &'static LocalKey<Cell<bool>>,
    before: bool,
}

impl Flag {
    fn raise(of: &'static LocalKey<Cell<bool>>) -> Self {
        Self { of, before: of.replace(true) }
    }
}

impl Drop for Flag {
    fn drop(&mut self) {
        self.of.set(self.before);
    }
}

/// Returns the number of threads that a loop begun here may take.
pub(crate) fn threads() -> usize {
    match WORKERS.with_borrow(Clone::clone) {
        Some(workers) => workers.pool().map_or(1, ThreadPool::current_num_threads),
        None => rayon::current_num_threads(),
    }
}

/// Runs the work on one of the [`Workers`], or of rayon's threads.
///
/// A parallel loop started outside rayon's pool puts its thread to sleep and wakes two, which takes as long as a
/// million products. Inside the pool it takes one call.
pub fn among_workers<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let workers = WORKERS.with_borrow(Clone::clone);
    let elsewhere = || {
        let before = SHARED.get();
        (work(), SHARED.get() - before)
    };
    let (result, shared) = match &workers {
        None if rayon::current_thread_index().is_some() => return elsewhere().0,
        None => rayon::scope(|_| elsewhere()),
        Some(workers) => match workers.pool() {
            None => return elsewhere().0,
            Some(pool) => pool.install(elsewhere),
        },
    };
    SHARED.set(SHARED.get() + shared);
    result
}

/// Runs the work as [`among_workers`] does, for many short loops. All other workers wait for them awake, so that a
/// loop of some microseconds can be shared: waking one takes ten times as long.
///
/// They yield to other work on their cores. [`waited`] returns how long they waited.
pub fn among_awake_workers<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    among_workers(|| {
        let first = rayon::current_thread_index();
        // On a thread of no pool the work is alone.
        let Some(first) = first.filter(|_| rayon::current_num_threads() > 1 && !WORKS.get()) else { return work() };
        rayon::scope(|scope| {
            let update = Update::begin();
            let team = Arc::clone(&update.team);
            scope.spawn_broadcast(move |_, worker| {
                if worker.index() != first && !WORKS.get() {
                    wait_awake(&team);
                }
            });
            work()
        })
    })
}

/// Returns the time that workers have waited awake in this program so far, summed over workers. The system counts
/// them as busy.
pub fn waited() -> Duration {
    Duration::from_nanos(WAITED.load(Ordering::Relaxed))
}

/// Returns the time that this thread has spent so far in loops that it shared with others; that of work which it had
/// done [`among_workers`] counts, too. In the rest of its time one thread works, at most.
pub fn shared_time() -> Duration {
    SHARED.get()
}

/// Returns whether workers wait awake for the loops of this thread, so that even short ones can be shared.
pub(crate) fn are_awake() -> bool {
    TEAM.with_borrow(Option::is_some)
}

/// The workers of an update.
#[derive(Debug, Default)]
struct Team {
    /// Number of loops that were announced.
    loops: AtomicU64,
    is_over: AtomicBool,
}

/// Keeps workers awake while it exists; a panic ends it, too.
struct Update {
    team: Arc<Team>,
    _works: Flag,
    _before: Restore<Option<Arc<Team>>>,
}

impl Update {
    fn begin() -> Self {
        let team = Arc::<Team>::default();
        let before = Restore::after(&TEAM, Some(Arc::clone(&team)));
        Self { team, _works: Flag::raise(&WORKS), _before: before }
    }
}

impl Drop for Update {
    fn drop(&mut self) {
        self.team.is_over.store(true, Ordering::Release);
    }
}

fn wait_awake(team: &Arc<Team>) {
    // Loops within a piece of a loop are shared, too.
    let _until_the_end = Restore::after(&TEAM, Some(Arc::clone(team)));
    let (mut waited, mut since, mut seen) = (Duration::ZERO, Instant::now(), 0);
    for look in 0u64.. {
        if team.is_over.load(Ordering::Acquire) || since.elapsed() >= PATIENCE {
            break;
        }
        let loops = team.loops.load(Ordering::Acquire);
        if loops != seen || look.is_multiple_of(UNANNOUNCED) {
            seen = loops;
            while yield_now() == Some(Yield::Executed) {
                since = Instant::now();
            }
        }
        let start = Instant::now();
        pause();
        waited += start.elapsed();
    }
    WAITED.fetch_add(waited.as_nanos() as u64, Ordering::Relaxed);
}

fn pause() {
    (0..PAUSES).for_each(|_| spin_loop());
    std::thread::yield_now();
}

// Loops that threads share.

/// Returns the number of other threads that a loop of so many pieces is shared with, if that takes `most` at most.
pub(crate) fn helpers(pieces: usize, most: usize) -> usize {
    match pieces.min(most.saturating_add(1)) {
        0 | 1 => 0,
        takers => takers.min(threads()) - 1,
    }
}

/// Does the work of each piece, on this thread and on so many others as far as they have time. Each thread has a state
/// of its own, made before its first piece, and takes the next piece after each.
pub(crate) fn share_pieces<T: Send, S>(
    pieces: impl Iterator<Item = T> + Send,
    helpers: usize,
    state: impl Fn() -> S + Sync,
    work: impl Fn(&mut S, T) + Sync,
) {
    if helpers == 0 {
        let mut own = None;
        return pieces.for_each(|piece| work(own.get_or_insert_with(&state), piece));
    }
    let (start, is_part) = (Instant::now(), SHARES.get());
    among_workers(|| share_in_pool(pieces, helpers, &state, &work));
    if !is_part {
        SHARED.set(SHARED.get() + start.elapsed());
    }
}

fn share_in_pool<T: Send, S>(
    pieces: impl Iterator<Item = T> + Send,
    helpers: usize,
    state: &(impl Fn() -> S + Sync),
    work: &(impl Fn(&mut S, T) + Sync),
) {
    let (left, busy) = (Mutex::new(pieces), AtomicUsize::new(0));
    let next = || left.lock().unwrap_or_else(PoisonError::into_inner).next();
    let take = || {
        let _shares = Flag::raise(&SHARES);
        let mut own = None;
        while let Some(piece) = next() {
            work(own.get_or_insert_with(state), piece);
        }
    };
    rayon::scope(|scope| {
        for _ in 0..helpers {
            scope.spawn(|_| {
                let _until_the_end = Busy::begin(&busy);
                take();
            });
        }
        TEAM.with_borrow(|team| {
            if let Some(team) = team {
                team.loops.fetch_add(1, Ordering::Release);
            }
        });
        take();
        // Sleeping and being woken takes longer than most pieces.
        let mut looks = 0;
        while busy.load(Ordering::Acquire) > 0 && looks < LOOKS {
            pause();
            looks += 1;
        }
    });
}

/// Counts a thread that works on a loop, until it is dropped.
struct Busy<'a>(&'a AtomicUsize);

impl<'a> Busy<'a> {
    fn begin(count: &'a AtomicUsize) -> Self {
        count.fetch_add(1, Ordering::AcqRel);
        Self(count)
    }
}

impl Drop for Busy<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{
        collections::HashSet,
        panic::{AssertUnwindSafe, catch_unwind},
        thread,
        thread::ThreadId,
    };

    /// Returns the threads that share a loop of `pieces` that wait until so many threads have come.
    fn takers(pieces: usize, wanted: usize) -> HashSet<ThreadId> {
        let seen = Mutex::new(HashSet::new());
        let count = || seen.lock().expect("no panic").len();
        let work = |_: &mut (), _| {
            seen.lock().expect("no panic").insert(thread::current().id());
            while count() < wanted {
                thread::yield_now();
            }
        };
        share_pieces(0..pieces, helpers(pieces, usize::MAX), || (), work);
        seen.into_inner().expect("no panic")
    }

    #[test]
    fn loops_take_all_the_threads_that_are_allowed_and_no_others() {
        let own = thread::current().id();
        for threads in [1, 2, 5] {
            let workers = Workers::new(threads);
            workers.bound(|| {
                let alone = takers(100, threads);
                assert_eq!(alone.len(), threads);
                assert_eq!(alone.contains(&own), threads == 1, "this thread is none of several");
                assert_eq!(takers(100, threads), alone, "they are the same in each loop");
                assert_eq!(among_workers(|| takers(100, threads)), alone);
                assert_eq!(among_awake_workers(|| takers(100, threads)), alone);
                assert_eq!(among_awake_workers(|| among_awake_workers(|| takers(100, threads))), alone);
                assert_eq!(takers(1, 1).len(), 1, "a piece is not divided");
            });
        }
    }

    #[test]
    fn a_bound_holds_on_its_thread_until_its_end() {
        assert_eq!(threads(), rayon::current_num_threads());
        Workers::new(3).bound(|| {
            assert_eq!(threads(), 3);
            Workers::new(0).bound(|| assert_eq!(threads(), 1));
            assert_eq!(threads(), 3);
            assert_eq!(among_workers(threads), 3);
            let pool = |workers: Workers| workers.bound(|| takers(100, 3));
            assert_eq!(pool(Workers::here(3)), pool(Workers::here(3)));
            assert!(pool(Workers::new(3)).is_disjoint(&pool(Workers::here(3))));
            assert!(catch_unwind(|| Workers::new(2).bound(|| panic!("stop"))).is_err() && threads() == 3);
            thread::scope(|scope| {
                assert_eq!(scope.spawn(threads).join().expect("no panic"), rayon::current_num_threads())
            });
        });
        assert_eq!(threads(), rayon::current_num_threads());
    }

    #[test]
    fn loops_within_pieces_are_shared_and_each_thread_has_one_state() {
        let states = AtomicUsize::new(0);
        let sum = AtomicUsize::new(0);
        let add_one = |_: &mut (), _| {
            sum.fetch_add(1, Ordering::Relaxed);
        };
        let add = |_: &mut usize, number| share_pieces(0..number, helpers(number, usize::MAX), || (), add_one);
        Workers::new(3).bound(|| {
            among_awake_workers(|| share_pieces(0..50, 2, || states.fetch_add(1, Ordering::Relaxed), add));
        });
        assert_eq!(sum.load(Ordering::Relaxed), 1225);
        assert!((1..=3).contains(&states.load(Ordering::Relaxed)));
    }

    #[test]
    fn workers_wait_awake_and_go_back_to_sleep() {
        Workers::new(2).bound(|| {
            let before = waited();
            among_awake_workers(|| {
                assert!(are_awake());
                assert_eq!(takers(2, 2).len(), 2, "another worker is there");
                thread::park_timeout(2 * PATIENCE);
            });
            assert!(!are_awake());
            // The end of an update waits for them.
            assert!(waited() > before, "it has waited meanwhile");
        });
    }

    #[test]
    fn time_with_others_is_that_of_whole_loops() {
        let (before, start) = (shared_time(), Instant::now());
        Workers::new(1).bound(|| takers(100, 1));
        assert_eq!(shared_time(), before);
        Workers::new(2).bound(|| among_awake_workers(|| share_pieces(0..4, 1, || (), |(), _| drop(takers(2, 1)))));
        let shared = shared_time() - before;
        assert!(shared > Duration::ZERO && shared <= start.elapsed(), "inner loops count once: {shared:?}");
    }

    #[test]
    fn several_updates_at_a_time_come_to_an_end() {
        thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..50 {
                        assert!(among_awake_workers(|| takers(20, 1)).len() <= rayon::current_num_threads());
                    }
                });
            }
        });
    }

    #[test]
    fn a_panic_ends_an_update_and_a_loop() {
        Workers::new(2).bound(|| {
            let broken = || share_pieces(0..9, 1, || (), |(), piece| assert!(piece < 7, "stop"));
            for _ in 0..3 {
                assert!(catch_unwind(AssertUnwindSafe(|| among_awake_workers(|| panic!("stop")))).is_err());
                assert!(catch_unwind(AssertUnwindSafe(|| among_awake_workers(broken))).is_err());
            }
            assert!(!are_awake() && !SHARES.get());
            assert_eq!(takers(10, 2).len(), 2);
        });
    }
}
