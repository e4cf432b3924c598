//! Visited share of a level.

use serde::{Deserialize, Serialize};

/// Visited squares, among all that walls do not cut off from the start: see
/// [`open_cells`](crate::explore::open_cells). Under gravity, some of these may be unreachable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Places {
    /// Open squares that were visited, or passed between two ticks.
    pub visited: u64,
    /// All open squares.
    pub open: u64,
}

impl Places {
    /// Returns the visited share in percent; `None` without open squares.
    pub fn percent(self) -> Option<f64> {
        (self.open > 0).then(|| 100.0 * self.visited as f64 / self.open as f64)
    }

    /// Formats the share.
    pub fn describe(self) -> String {
        self.percent().map_or_else(|| "–".to_owned(), |percent| format!("{percent:.1} %"))
    }

    /// Adds the squares of another level.
    pub(super) fn add(&mut self, other: Option<Self>) {
        let other = other.unwrap_or_default();
        self.visited = self.visited.saturating_add(other.visited);
        self.open = self.open.saturating_add(other.open);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_all_levels_together() {
        let mut places = Places::default();
        assert_eq!((places.percent(), places.describe().as_str()), (None, "–"));
        places.add(Some(Places { visited: 1, open: 10 }));
        places.add(None);
        places.add(Some(Places { visited: 9, open: 30 }));
        assert_eq!((places.percent(), places.describe().as_str()), (Some(25.0), "25.0 %"));
    }
}
