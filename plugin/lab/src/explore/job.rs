//! The task of one visit.

use super::{archive::Destination, ways::Route};

/// A path back to a cell, and the ticks to explore there.
pub(super) struct Job {
    /// Number of the visit in the whole exploration. Its random numbers are derived from it, so that any World may make
    /// it.
    pub number: u64,
    pub destination: Destination,
    /// The path back.
    pub route: Route,
    /// Ticks to explore without a find.
    pub patience: u32,
    /// Most ticks to explore.
    pub most: u32,
}
