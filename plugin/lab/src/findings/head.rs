//! The head of a finding's file.

use serde::{Deserialize, Serialize};

/// Newest form of the head that is read and written.
pub(super) const HEAD_FORMAT: u32 = 1;

/// The description of a finding: RON text in the note of the recording. Older programs ignore fields that they do not
/// know.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FindingHead {
    /// Form of the head: 1.
    pub finding: u32,
    /// The level's name in results: `hard:7`, or the path of its file.
    pub level: String,
    /// The tester; `None` if the finding needs none.
    pub tester: Option<String>,
    /// Random seed of the agent in the episode.
    pub seed: u64,
    /// Name of the detector.
    pub detector: String,
    /// Tick of the finding in the episode, from 0; `None` if it needs no play.
    pub tick: Option<u32>,
    /// The message.
    pub message: String,
    /// Hash of the game's state after that tick, or after the last one before it if the game broke in it; `None` if
    /// there is no hash.
    pub state_hash: Option<u32>,
    /// Ticks of the episode before minimisation.
    pub original_ticks: u32,
    /// Settings of the detector that differ from the default, as `name.key=value`. Older files have no settings.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub settings: Vec<String>,
}

impl FindingHead {
    /// Creates the head of a finding whose tick is not known yet.
    pub fn new(level: impl Into<String>, detector: impl Into<String>, message: impl Into<String>) -> Self {
        Self {
            finding: HEAD_FORMAT,
            level: level.into(),
            tester: None,
            seed: 0,
            detector: detector.into(),
            tick: None,
            message: message.into(),
            state_hash: None,
            original_ticks: 0,
            settings: Vec::new(),
        }
    }
}
