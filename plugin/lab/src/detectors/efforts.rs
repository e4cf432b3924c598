//! The activity of an agent: how often it changes its action.

use bevy_playbot::action::ActionValue;

/// A count of an agent's changes of action.
#[derive(Default)]
pub(super) struct Efforts {
    last: Option<ActionValue>,
    changes: u32,
}

impl Efforts {
    /// Counts the action of this tick.
    pub fn note(&mut self, action: &ActionValue) {
        if self.last.as_ref() != Some(action) {
            self.changes += 1;
            self.last = Some(action.clone());
        }
    }

    /// Resets the count.
    pub fn restart(&mut self) {
        self.changes = 0;
    }

    /// Returns whether the action changed in at least a tenth of these ticks. An agent that holds one key for ever
    /// tries nothing.
    pub fn are_many(&self, ticks: u32) -> bool {
        self.changes.saturating_mul(10) >= ticks.max(20)
    }
}
