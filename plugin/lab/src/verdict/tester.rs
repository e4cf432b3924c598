//! Who tests.

use bevy_playbot::vision::ObservationConfig;
use serde::{Deserialize, Serialize};

use crate::eval::Player;

/// A player under a name, with what it sees.
#[derive(Clone)]
pub struct Tester {
    /// What files say of it.
    pub record: TesterRecord,
    /// The player.
    pub player: Player,
    /// What a learned policy sees; bots are left with vectors.
    pub observation_config: ObservationConfig,
}

/// What files say of a tester.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TesterRecord {
    /// Its name, unlike that of all others of the test.
    pub name: String,
    /// Checksum of the policy's file, for policies: another one is another tester.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checksum: Option<String>,
    /// Whether a policy takes its most probable action instead of drawing one.
    #[serde(default, skip_serializing_if = "is_false")]
    pub greedy: bool,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_false(value: &bool) -> bool {
    !value
}

impl TesterRecord {
    /// A bot of the game.
    pub fn bot(name: impl Into<String>) -> Self {
        Self { name: name.into(), checksum: None, greedy: false }
    }

    /// As people read it.
    pub fn describe(&self) -> String {
        let checksum = self.checksum.as_ref().map_or_else(String::new, |sum| format!(" (file {sum})"));
        format!("{}{checksum}{}", self.name, if self.greedy { ", greedy" } else { "" })
    }
}
