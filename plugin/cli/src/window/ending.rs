//! The orderly end of a window: the recording is finished before the window closes.

use crate::window::WindowError;
use bevy::{ecs::schedule::ScheduleLabel, prelude::*, window::WindowCloseRequested};
use bevy_playbot::{
    engine::{FaultSystems, flush_unfinished},
    fault::Faults,
    systems::PlaybotSystems,
};
use std::sync::{Arc, Mutex, PoisonError};

pub(super) fn build(app: &mut App, stop: fn() -> bool) {
    app.insert_resource(Ending { asked: false, ended: false, stop })
        .init_resource::<Verdict>()
        .add_systems(Last, (hear_close, end).chain().after(PlaybotSystems::Reset).before(FaultSystems));
}

/// Listens in frames that have no `Last`, too.
pub(super) fn listen_in(app: &mut App, schedule: impl ScheduleLabel) {
    app.add_systems(schedule, (hear_close, end).chain());
}

/// A request to end the window.
#[derive(Resource, Reflect)]
#[reflect(Component, from_reflect = false)]
pub(super) struct Ending {
    asked: bool,
    ended: bool,
    #[reflect(ignore)]
    stop: fn() -> bool,
}

impl Ending {
    /// Asks for the end.
    pub fn ask(&mut self) {
        self.asked = true;
    }
}

/// The error that ended the window, if it was not closed on purpose. Outlives the World.
#[derive(Resource, Clone, Default, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone)]
pub(super) struct Verdict(Arc<Mutex<Option<WindowError>>>);

impl Verdict {
    fn set(&self, error: WindowError) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }

    /// Returns the verdict of an app that has exited.
    pub fn take(&self, exit: AppExit) -> Result<(), WindowError> {
        match self.0.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(error) => Err(error),
            None if exit.is_error() => Err(WindowError::Lost("the display was closed".to_owned())),
            None => Ok(()),
        }
    }
}

fn hear_close(mut closes: MessageReader<WindowCloseRequested>, mut ending: ResMut<Ending>) {
    if closes.read().count() > 0 || (ending.stop)() {
        ending.asked = true;
    }
}

fn end(world: &mut World) {
    let verdict = world.resource::<Verdict>().clone();
    let fault = world.resource_mut::<Faults>().take();
    let mut ending = world.resource_mut::<Ending>();
    if ending.ended || (fault.is_ok() && !ending.asked) {
        return;
    }
    ending.ended = true;
    if let Err(fault) = fault {
        verdict.set(fault.into());
    }
    if let Err(error) = flush_unfinished(world) {
        verdict.set(error.into());
    }
    world.write_message(AppExit::Success);
}
