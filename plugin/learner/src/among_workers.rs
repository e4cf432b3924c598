//! Where updates run.

/// Does the work on one of rayon's threads.
///
/// Each loop that is shared out from any other thread puts that one to sleep and wakes two, which takes as long as a million
/// products; among rayon's threads it takes one call.
pub fn among_workers<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}
