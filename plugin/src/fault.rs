//! Breaches of contract by the game, collected where they happen and returned from
//! [`PlaybotAppExt::tick`](crate::headless::PlaybotAppExt::tick) instead of a panic.

use bevy::prelude::*;
use thiserror::Error;

/// Faults of the current tick; the first one is what the caller gets to see.
#[derive(Resource, Default, Debug)]
pub struct Faults {
    first: Option<String>,
}

/// The game broke its contract with the plugin.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("{0}")]
pub struct Fault(pub String);

impl Faults {
    /// Notes a fault: say which agent, which level, which tick and what.
    pub fn report(&mut self, what: String) {
        self.first.get_or_insert(what);
    }

    /// Takes the first fault, if any.
    pub fn take(&mut self) -> Result<(), Fault> {
        self.first.take().map_or(Ok(()), |what| Err(Fault(what)))
    }
}
