//! Faults: breaches of contract by the game, reported instead of a panic.
//!
//! Under [`tick`](crate::headless::PlaybotAppExt::tick) the first fault of a tick is returned as an error. In an app
//! that runs by itself each fault is logged as an error and triggers a [`FaultOccurred`] in the same frame.

use crate::carry_over::ReflectCarryResource;
use bevy::prelude::*;
use playbot_learner::HasExitCode;
use thiserror::Error;

/// Faults that have not been reported yet.
#[derive(Resource, Default, Debug, Reflect)]
#[reflect(Resource, CarryResource)]
pub struct Faults {
    waiting: Vec<String>,
    /// True if the caller of this tick gets the fault, so that it need not be announced.
    has_caller: bool,
}

/// The game broke its contract with the plugin.
#[derive(Debug, Error, Clone, PartialEq, Eq, Reflect)]
#[error("{0}")]
pub struct Fault(pub String);

impl HasExitCode for Fault {
    fn exit_code(&self) -> u8 {
        2
    }
}

/// A fault of the game, in an app without a caller that ticks it by hand. Triggered in
/// [`FaultSystems`].
///
/// ```
/// use bevy::{prelude::*, time::TimePlugin};
/// use bevy_playbot::{fault::{FaultOccurred, Faults}, prelude::*};
///
/// #[derive(Resource, Default)]
/// struct Heard(Vec<String>);
///
/// let mut app = App::new();
/// app.add_plugins((TimePlugin, PlaybotPlugin::default()))
///     .init_resource::<Heard>()
///     .add_observer(|event: On<FaultOccurred>, mut heard: ResMut<Heard>| heard.0.push(event.fault.to_string()))
///     .add_systems(Update, |mut faults: ResMut<Faults>| faults.report("agent 0: something is wrong".into()));
/// app.update();
/// assert_eq!(app.world().resource::<Heard>().0, ["agent 0: something is wrong"]);
/// ```
#[derive(Event, Debug, Clone, PartialEq, Eq, Reflect)]
pub struct FaultOccurred {
    /// The fault.
    pub fault: Fault,
}

/// In `Last`: faults are announced. Systems before it may still [`take`](Faults::take) them.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FaultSystems;

impl Faults {
    /// Notes a fault. The text names the agent, the level, the tick and the problem.
    pub fn report(&mut self, what: String) {
        self.waiting.push(what);
    }

    /// Takes all faults and returns the first: the others may follow from it.
    pub fn take(&mut self) -> Result<(), Fault> {
        std::mem::take(&mut self.waiting).into_iter().next().map_or(Ok(()), |what| Err(Fault(what)))
    }

    /// Sets whether a caller takes the faults from here on.
    pub(crate) fn set_caller(&mut self, has_caller: bool) {
        self.has_caller = has_caller;
    }

    /// Returns whether a caller ticks this World by hand and takes its faults.
    pub(crate) fn has_caller(&self) -> bool {
        self.has_caller
    }
}

/// Announces the faults of this frame, unless a caller takes them.
pub(crate) fn announce_faults(mut faults: ResMut<Faults>, mut commands: Commands) {
    if faults.has_caller || faults.waiting.is_empty() {
        return;
    }
    for what in std::mem::take(&mut faults.waiting) {
        tracing::error!("{what}");
        commands.trigger(FaultOccurred { fault: Fault(what) });
    }
}

#[cfg(test)]
mod tests {
    use std::{
        fmt::{Debug, Write},
        sync::{Arc, Mutex, PoisonError},
    };

    use tracing::{
        Event as LogEvent, Level, Metadata, Subscriber,
        field::{Field, Visit},
        span,
    };

    use super::*;

    /// Errors as text, as they were logged.
    #[derive(Clone, Default)]
    struct Log(Arc<Mutex<Vec<String>>>);

    impl Log {
        fn lines(&self) -> Vec<String> {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
        }
    }

    struct Message(String);

    impl Visit for Message {
        fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
            if field.name() == "message" {
                write!(self.0, "{value:?}").expect("text takes everything");
            }
        }
    }

    impl Subscriber for Log {
        fn enabled(&self, metadata: &Metadata) -> bool {
            *metadata.level() == Level::ERROR
        }

        fn event(&self, event: &LogEvent) {
            let mut message = Message(String::new());
            event.record(&mut message);
            self.0.lock().unwrap_or_else(PoisonError::into_inner).push(message.0);
        }

        fn new_span(&self, _: &span::Attributes) -> span::Id {
            span::Id::from_u64(1)
        }

        fn record(&self, _: &span::Id, _: &span::Record) {}

        fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}

        fn enter(&self, _: &span::Id) {}

        fn exit(&self, _: &span::Id) {}
    }

    #[derive(Resource, Default)]
    struct Heard(Vec<String>);

    #[test]
    fn a_fault_that_is_not_taken_is_logged_as_an_error_beside_its_event() {
        let mut world = World::new();
        world.init_resource::<Faults>();
        world.init_resource::<Heard>();
        world.add_observer(|event: On<FaultOccurred>, mut heard: ResMut<Heard>| heard.0.push(event.fault.to_string()));
        let mut last = Schedule::default();
        last.add_systems(announce_faults);
        let log = Log::default();
        let mut report = |world: &mut World, has_caller: bool, what: &str| {
            let mut faults = world.resource_mut::<Faults>();
            faults.set_caller(has_caller);
            faults.report(what.to_owned());
            tracing::subscriber::with_default(log.clone(), || last.run(world));
        };
        report(&mut world, false, "agent 0: something is wrong");
        assert_eq!(log.lines(), ["agent 0: something is wrong"]);
        assert_eq!(world.resource::<Heard>().0, log.lines());
        report(&mut world, true, "agent 0: another agent is reported");
        assert_eq!(log.lines().len(), 1, "the caller that ticks the World gets this one");
    }
}
