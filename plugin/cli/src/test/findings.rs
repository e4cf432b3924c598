//! Which findings are written while levels are tested.

use std::path::Path;

use playbot_lab::{
    detectors::Detectors,
    findings::{Budget, Checks, FindingFiles},
};

/// Findings as files.
#[derive(clap::Args, Clone, Debug)]
pub struct FindingArgs {
    /// Leave out the actions that findings do not need, which takes up to 500 replays each; `playbot replay` does it for a
    /// single one.
    #[arg(long)]
    minimise: bool,
    /// Also write a failed episode of each level that no tester solved, if a tester failed that leaves nothing to chance.
    #[arg(long)]
    keep_failures: bool,
}

impl FindingArgs {
    /// Where they go, and which.
    pub fn files(&self, folder: &Path, detectors: &Detectors) -> FindingFiles {
        FindingFiles {
            folder: folder.to_owned(),
            minimise: self.minimise.then(Budget::default),
            keep_failures: self.keep_failures,
            checks: Checks::default().with_detectors(detectors),
        }
    }
}
