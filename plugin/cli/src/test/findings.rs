//! Options for the findings of a test.

use std::path::Path;

use playbot_lab::{
    detectors::Detectors,
    findings::{Budget, Checks, FindingFiles, list_findings},
};

/// Findings as files.
#[derive(clap::Args, Clone, Debug)]
pub struct FindingArgs {
    /// Leave out actions that findings do not need, with up to 500 replays each. `playbot replay` does it for a single
    /// one.
    #[arg(long)]
    minimise: bool,
    /// Also write a failed episode of each level that no tester solved, if a deterministic tester failed there.
    #[arg(long)]
    keep_failures: bool,
}

impl FindingArgs {
    /// Returns the folder of findings and the options for them.
    pub fn files(&self, folder: &Path, detectors: &Detectors) -> FindingFiles {
        FindingFiles {
            folder: folder.to_owned(),
            minimise: self.minimise.then(Budget::default),
            keep_failures: self.keep_failures,
            checks: Checks::default().with_detectors(detectors),
        }
    }

    /// Explains a missing failed episode, where one was requested.
    pub fn tell_missing(&self, folder: &Path) {
        if self.keep_failures && list_findings(folder).is_err() {
            tell!(
                "no failed episode is kept: it takes a level that no tester solved, and a tester that failed there and leaves \
                 nothing to chance, such as a policy with --greedy"
            );
        }
    }
}
