//! Several Worlds side by side on a few threads.

/// Runs `work` once for every item, on at most `threads` threads, and returns the results in the order of the items.
///
/// Which thread does what never shows in the results: each item is worked on alone.
pub fn on_threads<T: Send, R: Send>(items: &mut [T], threads: usize, work: impl Fn(&mut T) -> R + Sync) -> Vec<R> {
    let threads = threads.clamp(1, items.len().max(1));
    if threads == 1 {
        return items.iter_mut().map(work).collect();
    }
    let share = items.len().div_ceil(threads);
    std::thread::scope(|scope| {
        let handles: Vec<_> = items
            .chunks_mut(share)
            .map(|chunk| scope.spawn(|| chunk.iter_mut().map(&work).collect::<Vec<R>>()))
            .collect();
        handles
            .into_iter()
            .flat_map(|handle| handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    })
}

/// Threads to use when nobody says: one per core.
pub fn default_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
