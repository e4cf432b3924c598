//! The end of a window: the orderly one, with the recording finished before the window closes, and that by an error.

use bevy::{ecs::schedule::ScheduleLabel, prelude::*, window::WindowCloseRequested};
use bevy_playbot::{
    demo::file::DemoFileError,
    engine::{FaultSystems, flush_unfinished, panics::place_of_panic},
    fault::{Fault, Faults},
    systems::PlaybotSystems,
    vision::VisionError,
};
use playbot_learner::HasExitCode;
use std::{
    panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook},
    sync::{Arc, Mutex, PoisonError},
};
use thiserror::Error;

// The orderly end.

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

// The errors of opening a window and of running it.

/// An error of opening a window or of running it.
#[derive(Debug, Error)]
pub enum WindowError {
    /// There is no display to open a window on.
    #[error(
        "no window can be opened ({0}): start this in a desktop session, or set DISPLAY to a running X server such as \
         `Xvfb :99`; without a display there is `playbot eval`"
    )]
    NoDisplay(String),
    /// A library of the window system is missing.
    #[error(
        "no window can be opened, since a library is missing ({0}): on Debian, install libx11-6, libx11-xcb1, libxcursor1, \
         libxi6 and libxkbcommon-x11-0; without them there is `playbot eval`"
    )]
    NoLibrary(String),
    /// No device can draw.
    #[error(
        "nothing here can draw a window ({0}): install a Vulkan driver, such as Debian's mesa-vulkan-drivers, which \
         needs no graphics card; without one there is `playbot eval`"
    )]
    NoAdapter(String),
    /// The game has no keys.
    #[error(
        "{0} has no keys for a person to play with: let the game name them (`key_bindings`), or watch a bot play with \
         `playbot view {0} --episode`"
    )]
    NoKeys(&'static str),
    /// A person's actions in the game cannot be recorded.
    #[error(
        "a person's actions in {0} cannot be recorded, since a system of its own passes them on (`.actions`): declare them \
         with `.keys`, `.axes` or `.input`, leave out --record, or record its bots with `playbot record`"
    )]
    NotRecorded(&'static str),
    /// The game, or the policy's observation, cannot be drawn.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The running episode could not be written down.
    #[error(transparent)]
    Recording(#[from] DemoFileError),
    /// The window system or the graphics driver gave up.
    #[error("the window is gone ({0}); finished episodes are saved, the running one is lost")]
    Lost(String),
}

impl HasExitCode for WindowError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Fault(_) | Self::Recording(_) | Self::Lost(_) => 2,
            // Whatever is missing, the caller can install it or call from elsewhere.
            _ => 3,
        }
    }
}

/// A panic in a window.
#[derive(Debug, Default, PartialEq)]
pub(super) struct WindowPanic {
    /// The message on one line.
    words: String,
    /// File, line and, if they are known, plugin or system, in parentheses after a space.
    place: String,
}

impl From<WindowPanic> for WindowError {
    /// Turns a panic of Bevy's plugins into an error. They have no other way to report that something is missing.
    fn from(WindowPanic { words, place }: WindowPanic) -> Self {
        if words.contains("XOpenDisplayFailed") {
            let display = std::env::var("DISPLAY").unwrap_or_default();
            Self::NoDisplay(format!("no X server answers at DISPLAY={display}"))
        } else if words.contains(".so") {
            Self::NoLibrary(words)
        } else if words.contains("event loop") {
            Self::NoDisplay(words)
        } else if words.contains("find a GPU") {
            Self::NoAdapter("there is no graphics adapter".to_owned())
        } else if ["adapter", "surface"].iter().any(|part| words.contains(part)) {
            Self::NoAdapter(words)
        } else {
            Self::Lost(format!("{words}{place}"))
        }
    }
}

/// Runs work that may panic, silently, and returns its panic.
pub(super) fn catch<T>(work: impl FnOnce() -> T) -> Result<T, WindowPanic> {
    let first = Arc::new(Mutex::new(None));
    let heard = first.clone();
    let hook = take_hook();
    set_hook(Box::new(move |panic| {
        let said = panic.payload_as_str().unwrap_or("no reason given");
        let words = said.split_whitespace().collect::<Vec<_>>().join(" ");
        // Later panics only follow from the first.
        let mut first = heard.lock().unwrap_or_else(PoisonError::into_inner);
        first.get_or_insert_with(|| WindowPanic { words, place: place_of_panic(panic) });
        tracing::debug!("{panic}");
    }));
    let result = catch_unwind(AssertUnwindSafe(work));
    set_hook(hook);
    result.map_err(|_| first.lock().unwrap_or_else(PoisonError::into_inner).take().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panics_become_words() {
        assert_eq!(catch(|| 7), Ok(7));
        let panic = catch(|| panic!("no\n  luck")).expect_err("it panics");
        assert_eq!(panic.words, "no luck");
        assert!(panic.place.starts_with(" (") && panic.place.contains("ending.rs:"), "{}", panic.place);
        for (words, kind) in [
            ("Failed to build event loop: XNotSupported(XOpenDisplayFailed)", "no X server answers at DISPLAY="),
            ("Failed to build event loop: no libX11.so", "install libx11-6"),
            ("Unable to find a GPU! Make sure", "mesa-vulkan-drivers"),
            ("No supported formats for surface", "nothing here can draw a window (No supported formats"),
            ("index out of bounds", "the window is gone (index out of bounds (src/game.rs:3:9))"),
        ] {
            let panic = WindowPanic { words: words.to_owned(), place: " (src/game.rs:3:9)".to_owned() };
            let error = WindowError::from(panic).to_string();
            assert!(error.contains(kind), "{error}");
        }
    }
}
