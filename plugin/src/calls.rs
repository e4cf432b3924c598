//! Calls of a game that are under way, for messages about those that take long.
//!
//! A solver, a proof or a level generator that never returns stops a test without a word. So each thread notes what it
//! has called, for which levels, and a program that looks now and then sees which calls have not returned since.

use std::{
    collections::BTreeMap,
    fmt,
    fmt::{Display, Formatter},
    marker::PhantomData,
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
};

/// Most levels of a call that are named.
const MOST_NAMED: usize = 8;

/// A call of a game, from [`begin`](Self::begin) until this is dropped. Calls within it count as calls of their own.
#[must_use]
pub struct GameCall(PhantomData<*const ()>);

impl GameCall {
    /// Notes that this thread calls the game for these levels. `what` is as in "proving", before "level 7".
    pub fn begin(what: &'static str, levels: impl IntoIterator<Item = u64>) -> Self {
        let mut call = Call { what, levels: [0; MOST_NAMED], count: 0 };
        levels.into_iter().for_each(|level| call.add(level));
        on_own(|own| {
            own.beats += 1;
            own.open.push(call);
        });
        Self(PhantomData)
    }

    /// Adds a level that begins in this tick.
    pub(crate) fn add_level(level: u64) {
        on_own(|own| own.open.last_mut().into_iter().for_each(|call| call.add(level)));
    }
}

impl Drop for GameCall {
    fn drop(&mut self) {
        on_own(|own| {
            own.beats += 1;
            own.open.pop();
        });
    }
}

/// A call with its first levels. It needs no memory of its own, since there is one in each tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Call {
    what: &'static str,
    levels: [u64; MOST_NAMED],
    count: usize,
}

impl Call {
    fn add(&mut self, level: u64) {
        if let Some(free) = self.levels.get_mut(self.count) {
            *free = level;
        }
        self.count += 1;
    }
}

/// The calls of a thread.
#[derive(Default)]
struct ThreadCalls {
    /// Calls that have begun and ended.
    beats: u64,
    /// Calls that have not ended, the outermost first.
    open: Vec<Call>,
}

/// All threads that have called a game, each with its number.
struct Threads {
    last: u64,
    all: Vec<(u64, Weak<Mutex<ThreadCalls>>)>,
}

static THREADS: Mutex<Threads> = Mutex::new(Threads { last: 0, all: Vec::new() });

thread_local! {
    static OWN: Arc<Mutex<ThreadCalls>> = {
        let own = Arc::<Mutex<ThreadCalls>>::default();
        let mut threads = lock(&THREADS);
        threads.last += 1;
        let number = threads.last;
        threads.all.retain(|(_, thread)| thread.strong_count() > 0);
        threads.all.push((number, Arc::downgrade(&own)));
        own
    };
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Changes the calls of this thread, unless the thread is about to end.
fn on_own(change: impl FnOnce(&mut ThreadCalls)) {
    let _ = OWN.try_with(|own| change(&mut lock(own)));
}

/// Finds calls that take long: [`look`](Self::look) now and then.
#[derive(Default)]
pub struct SlowCalls {
    /// The state of each thread at the last look, and the looks for which it has been the same.
    seen: BTreeMap<u64, (u64, u32)>,
}

impl SlowCalls {
    /// Returns the calls that were under way at the last look already, and of each thread the innermost.
    pub fn look(&mut self) -> Vec<SlowCall> {
        let alive = |(number, thread): &(u64, Weak<Mutex<ThreadCalls>>)| Some((*number, thread.upgrade()?));
        let threads: Vec<_> = lock(&THREADS).all.iter().filter_map(alive).collect();
        let (mut slow, mut seen) = (Vec::new(), BTreeMap::new());
        for (number, thread) in threads {
            let thread = lock(&thread);
            let Some(call) = thread.open.last() else { continue };
            let before = self.seen.get(&number).filter(|(beats, _)| *beats == thread.beats);
            let looks = before.map_or(0, |(_, looks)| looks + 1);
            if looks > 0 {
                slow.push(SlowCall { looks, call: *call });
            }
            seen.insert(number, (thread.beats, looks));
        }
        self.seen = seen;
        slow
    }
}

/// A call that has not returned for some time. In words it is, for instance, "proving level 7".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlowCall {
    /// Looks since the one that saw it first.
    pub looks: u32,
    call: Call,
}

impl Display for SlowCall {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Call { what, levels, count } = self.call;
        let mut named = levels[..count.min(MOST_NAMED)].to_vec();
        named.sort_unstable();
        named.dedup();
        let names: Vec<String> = named.iter().map(u64::to_string).collect();
        let others = count.saturating_sub(MOST_NAMED);
        match (names.as_slice(), others) {
            ([], _) => write!(f, "{what} before the first level"),
            ([only], 0) => write!(f, "{what} level {only}"),
            ([first @ .., last], 0) => write!(f, "{what} levels {} and {last}", first.join(", ")),
            (all, others) => write!(f, "{what} levels {} and {others} more", all.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the slow calls with this level, without those of other tests.
    fn seen(slow: &mut SlowCalls, level: &str) -> Vec<(u32, String)> {
        let words = slow.look().into_iter().map(|call| (call.looks, call.to_string()));
        words.filter(|(_, words)| words.contains(level)).collect()
    }

    #[test]
    fn a_call_that_does_not_return_is_named_with_its_level() {
        let mut slow = SlowCalls::default();
        let outer = GameCall::begin("proving", [70_001]);
        assert_eq!(seen(&mut slow, "70001"), []);
        for looks in 1..3 {
            assert_eq!(seen(&mut slow, "70001"), [(looks, "proving level 70001".to_owned())]);
        }
        let inner = GameCall::begin("drawing the floor plan of", [70_001]);
        assert_eq!(seen(&mut slow, "70001"), []);
        assert_eq!(seen(&mut slow, "70001"), [(1, "drawing the floor plan of level 70001".to_owned())]);
        drop(inner);
        assert_eq!(seen(&mut slow, "70001"), [], "something has happened since");
        drop(outer);
        assert_eq!((seen(&mut slow, "70001"), seen(&mut slow, "70001")), (vec![], vec![]));
    }

    #[test]
    fn of_many_levels_the_first_are_named() {
        let _call = GameCall::begin("playing", 90_001..=90_011);
        let mut slow = SlowCalls::default();
        assert_eq!(seen(&mut slow, "90001"), []);
        let words = "playing levels 90001, 90002, 90003, 90004, 90005, 90006, 90007, 90008 and 3 more";
        assert_eq!(seen(&mut slow, "90001"), [(1, words.to_owned())]);
        let without = SlowCall { looks: 1, call: Call { what: "playing", levels: [0; MOST_NAMED], count: 0 } };
        assert_eq!(without.to_string(), "playing before the first level");
    }
}
