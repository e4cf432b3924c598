//! Of which levels results have maps.

use serde::{Deserialize, Serialize};

/// Most levels of a range all of which have maps: as many as the page shows.
const MOST_LEVELS: u64 = 2_000;

/// Of which levels results say where agents went. The number of levels of the whole range decides, so that its shards say the
/// same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MapScope {
    /// Of none, as in results that are older than maps.
    #[default]
    None,
    /// Of those that were not solved each time, or of which something was found.
    Failed,
    /// Of all.
    All,
}

impl MapScope {
    /// That of a range of so many levels.
    pub fn of(levels: u64) -> Self {
        if levels <= MOST_LEVELS { Self::All } else { Self::Failed }
    }

    /// As files and people have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Failed => "failed",
            Self::All => "all",
        }
    }

    /// Whether a level has maps.
    pub(super) fn wants(self, is_perfect: bool) -> bool {
        match self {
            Self::None => false,
            Self::Failed => !is_perfect,
            Self::All => true,
        }
    }

    /// For files, which do not mention what older ones do not know.
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
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
