//! Scope of the maps in results.

use serde::{Deserialize, Serialize};

/// Largest number of levels of a range that all have maps: as many as the page shows.
const MOST_LEVELS: u64 = 2_000;

/// The levels whose results have maps of where agents went. The size of the whole range decides, so its shards agree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MapScope {
    /// No level, as in results that are older than maps.
    #[default]
    None,
    /// Levels that were not solved each time, or that have a finding.
    Failed,
    /// All levels.
    All,
}

impl MapScope {
    /// Returns the scope for a range of so many levels.
    pub fn of(levels: u64) -> Self {
        if levels <= MOST_LEVELS { Self::All } else { Self::Failed }
    }

    /// Returns the name in files and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Failed => "failed",
            Self::All => "all",
        }
    }

    /// Returns whether a level has maps.
    pub(super) fn wants(self, is_perfect: bool) -> bool {
        match self {
            Self::None => false,
            Self::Failed => !is_perfect,
            Self::All => true,
        }
    }

    /// Returns whether no level has maps; files leave the key out then, as older versions do.
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde requires this signature")]
    pub(super) fn is_none(&self) -> bool {
        *self == Self::None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_levels_only_those_that_failed_have_maps() {
        assert_eq!([1, 2_000, 2_001].map(MapScope::of), [MapScope::All, MapScope::All, MapScope::Failed]);
        for (scope, name, of_perfect, of_others) in [
            (MapScope::None, "none", false, false),
            (MapScope::Failed, "failed", false, true),
            (MapScope::All, "all", true, true),
        ] {
            assert_eq!((scope.wants(true), scope.wants(false)), (of_perfect, of_others));
            assert_eq!(serde_json::to_string(&scope).expect("serialises"), format!("\"{name}\""));
            assert_eq!(scope.name(), name);
        }
    }
}
