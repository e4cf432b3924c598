//! The states at the ends of a rollout and of the episodes that it cuts off.

use crate::{ObsKind, Observations};

/// States that are in no row of a rollout: where episodes were cut off, and where the rollout stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct EndStates {
    /// Rows that cut an episode off without terminating it, ascending.
    pub cut_rows: Vec<usize>,
    /// Last observation of each of those episodes.
    pub cut_obs: Observations,
    /// The skill under which that observation is valued, `cut_rows * latent`.
    pub cut_z: Vec<f32>,
    /// Remaining share of that skill, as in [`Rollout::left`](crate::Rollout::left).
    pub cut_left: Vec<f32>,
    /// Observation after the last row of each environment, `B`; zeros where that row ended an episode.
    pub next_obs: Observations,
    /// The skill active there, `B * latent`.
    pub next_z: Vec<f32>,
    /// Remaining share of that skill, `B`, or empty.
    pub next_left: Vec<f32>,
}

impl EndStates {
    /// Creates a value without states.
    pub fn new(kind: &ObsKind) -> Self {
        let none = || Observations::empty(kind);
        let empty = Vec::new;
        Self {
            cut_rows: Vec::new(),
            cut_obs: none(),
            cut_z: empty(),
            cut_left: empty(),
            next_obs: none(),
            next_z: empty(),
            next_left: empty(),
        }
    }

    /// Removes all states and keeps the memory.
    pub(super) fn clear(&mut self) {
        self.cut_rows.clear();
        self.cut_obs.clear();
        self.cut_z.clear();
        self.cut_left.clear();
        self.next_obs.clear();
        self.next_z.clear();
        self.next_left.clear();
    }
}
