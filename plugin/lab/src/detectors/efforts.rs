//! Whether an agent tries anything.

use bevy_playbot::action::ActionValue;

/// How often an agent has tried something else.
#[derive(Default)]
pub(super) struct Efforts {
    last: Option<ActionValue>,
    changes: u32,
}

impl Efforts {
    /// Notes what it does now.
    pub fn note(&mut self, action: &ActionValue) {
        if self.last.as_ref() != Some(action) {
            self.changes += 1;
            self.last = Some(action.clone());
        }
    }

    /// Forgets how often.
    pub fn restart(&mut self) {
        self.changes = 0;
    }

    /// Whether it did something else in at least every tenth of so many ticks. Who holds one key for ever tries nothing.
    pub fn are_many(&self, ticks: u32) -> bool {
        self.changes.saturating_mul(10) >= ticks.max(20)
    }
}
