//! Errors that a game logs.

use crate::detector::{Detector, WorldMoment, WorldWatch};

/// A finding for games that log an error. Errors of the engine and of missing files are not the game's code and do not
/// count.
#[derive(Default)]
pub struct ErrorLog;

impl Detector for ErrorLog {
    fn name(&self) -> &'static str {
        "error-log"
    }

    fn describe(&self) -> &'static str {
        "the game logs an error"
    }

    fn watch_world(&self) -> Option<Box<dyn WorldWatch>> {
        Some(Box::new(Self))
    }
}

impl WorldWatch for ErrorLog {
    fn hears_errors(&self) -> bool {
        true
    }

    fn tick(&mut self, moment: &WorldMoment<'_>) -> Option<String> {
        moment.errors.first().map(|error| format!("the game logged an error: {error}"))
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::World;

    use super::*;

    #[test]
    fn the_first_error_is_told_and_silence_is_sound() {
        let world = World::new();
        let errors = ["no such door".to_owned(), "no such key".to_owned()];
        let mut watch = ErrorLog.watch_world().expect("it looks at Worlds");
        let told = watch.tick(&WorldMoment { world: &world, errors: &errors });
        assert_eq!(told.as_deref(), Some("the game logged an error: no such door"));
        assert_eq!(watch.tick(&WorldMoment { world: &world, errors: &[] }), None);
    }
}
