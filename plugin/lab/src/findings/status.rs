//! The status of a replayed finding.

use serde::Serialize;

/// The status of a replayed finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FindingStatus {
    /// It happens in the same tick with the same state.
    StillThere,
    /// It happens, in another tick or with another state.
    Changed,
    /// It does not happen any more.
    Gone,
    /// It cannot be played: the level no longer exists, the game differs, or the file is damaged.
    Unplayable,
}

impl FindingStatus {
    /// Returns the name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::StillThere => "still-there",
            Self::Changed => "changed",
            Self::Gone => "gone",
            Self::Unplayable => "unplayable",
        }
    }
}
