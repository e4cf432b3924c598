//! What a file says of its finding.

use serde::{Deserialize, Serialize};

/// Newest form of the head that is read and written.
pub(super) const HEAD_FORMAT: u32 = 1;

/// What was found, by whom and where: RON text in the note of the recording. What an older program does not know in it, it
/// leaves aside.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FindingHead {
    /// Form of the head: 1.
    pub finding: u32,
    /// The level as results call it: `hard:7`, or the path of its file.
    pub level: String,
    /// Who played; `None` if nobody had to.
    pub tester: Option<String>,
    /// Seed of the agent's random streams in the episode.
    pub seed: u64,
    /// What found it.
    pub detector: String,
    /// Tick of the episode in which it was found, from 0; `None` if nobody had to play.
    pub tick: Option<u32>,
    /// What is wrong.
    pub message: String,
    /// Hash of the game's state after that tick, or after the last one before it if the game broke in it; `None` if there is
    /// none.
    pub state_hash: Option<u32>,
    /// Ticks of the episode before any were left out.
    pub original_ticks: u32,
    /// Settings of the detector that were not the usual ones, as `name.key=value`. Older files have none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub settings: Vec<String>,
}

impl FindingHead {
    /// Of something that was found, before it is known in which tick.
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
