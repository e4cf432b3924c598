//! The ancestry of a run: the run that it began with, and those before.

use crate::experiment::Algorithm;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The run that a run began with, and the runs before that one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ancestor {
    /// Its folder, as it was named then.
    pub run: PathBuf,
    /// Environment steps of the checkpoint.
    pub step: u64,
    /// Its algorithm; unknown in runs of older versions, like the values below.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub algorithm: Option<Algorithm>,
    /// [Checksum](playbot_harness::sealed_file::file_checksum) of the checkpoint's learner.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checksum: Option<String>,
    /// Layers that were taken; none if only skills were.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub taken: Vec<String>,
    /// Layers that began anew.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub anew: Vec<String>,
    /// Observed values that the other run had not.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub new_inputs: usize,
    /// The run that this one had begun with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub begun_from: Option<Box<Self>>,
}

fn is_zero(number: &usize) -> bool {
    *number == 0
}

impl Ancestor {
    /// Iterates over this run and those before it, the latest first.
    pub fn chain(&self) -> impl Iterator<Item = &Self> {
        std::iter::successors(Some(self), |ancestor| ancestor.begun_from.as_deref())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ancestors_of_older_versions_are_read_and_written_as_before() {
        let old = r#"{"run":"runs/a","step":512}"#;
        let ancestor: Ancestor = serde_json::from_str(old).expect("readable");
        assert_eq!(serde_json::to_string(&ancestor).expect("writable"), old);
        let child = Ancestor { run: "runs/b".into(), begun_from: Some(Box::new(ancestor.clone())), ..ancestor };
        assert_eq!(child.chain().map(|run| run.run.display().to_string()).collect::<Vec<_>>(), ["runs/b", "runs/a"]);
    }
}
