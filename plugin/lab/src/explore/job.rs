//! One visit that is to be made.

use super::{archive::Destination, ways::Route};

/// A way back to a cell, and how long to explore there.
pub(super) struct Job {
    /// Number of the visit in the whole exploration: its random numbers come from it, so that it does not matter who makes it.
    pub number: u64,
    pub destination: Destination,
    /// The way there.
    pub route: Route,
    /// Ticks to explore without finding anything new.
    pub patience: u32,
    /// Ticks to explore at most.
    pub most: u32,
}
