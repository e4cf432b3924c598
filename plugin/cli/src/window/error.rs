//! Errors of opening a window and of running it, its orderly end, and the order of its levels.

use bevy::{ecs::schedule::ScheduleLabel, prelude::*, window::WindowCloseRequested};
use bevy_playbot::{
    demo::{file::DemoFileError, recorder::flush_unfinished},
    fault::{Fault, FaultSystems, Faults},
    systems::PlaybotSystems,
    vision::VisionError,
};
use playbot_harness::prelude::*;
use playbot_learner::HasExitCode;
use std::{
    panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook},
    sync::{Arc, Mutex, PoisonError},
};
use thiserror::Error;

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
        "a person's actions in {0} cannot be recorded, since it is not played with keys alone: leave out --record, or \
         record its bots with `playbot record`"
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

impl WindowError {
    /// Turns a panic of Bevy's plugins into an error. They have no other way to report that something is missing.
    pub(super) fn of_panic(words: String) -> Self {
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
            Self::Lost(words)
        }
    }
}

/// Runs work that may panic, silently, and returns the panic's message on one line.
pub(super) fn catch<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    let words = Arc::new(Mutex::new(String::new()));
    let heard = words.clone();
    let hook = take_hook();
    set_hook(Box::new(move |panic| {
        let said = panic.payload_as_str().unwrap_or("no reason given");
        let mut words = heard.lock().unwrap_or_else(PoisonError::into_inner);
        // Later panics only follow from the first.
        if words.is_empty() {
            *words = said.split_whitespace().collect::<Vec<_>>().join(" ");
        }
        tracing::debug!("{panic}");
    }));
    let result = catch_unwind(AssertUnwindSafe(work));
    set_hook(hook);
    result.map_err(|_| std::mem::take(&mut *words.lock().unwrap_or_else(PoisonError::into_inner)))
}

// Orderly end: the recording is finished before the window closes.

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

// Order of the levels in a window.

/// The levels of a session. A won level is followed by the next, a lost one comes again, and the first follows the
/// last.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug)]
pub struct Playlist {
    levels: LevelSplit,
    current: u64,
}

impl Playlist {
    /// Takes levels, and the first one to play.
    pub fn new(levels: LevelSplit, first: u64) -> Self {
        let current = first.clamp(levels.first, levels.last);
        Self { levels, current }
    }

    /// Returns the mode of the levels.
    pub fn mode(&self) -> &str {
        &self.levels.mode
    }

    /// Goes on to the next level.
    pub(super) fn advance(&mut self) {
        self.current = if self.current == self.levels.last { self.levels.first } else { self.current + 1 };
    }

    /// Returns the current level, as an agent's queue.
    pub(super) fn queue(&self) -> LevelQueue {
        LevelQueue::Always(self.current)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panics_become_words() {
        assert_eq!(catch(|| 7), Ok(7));
        assert_eq!(catch(|| panic!("no\n  luck")), Err::<(), _>("no luck".to_owned()));
        for (words, kind) in [
            ("Failed to build event loop: XNotSupported(XOpenDisplayFailed)", "no X server answers at DISPLAY="),
            ("Failed to build event loop: no libX11.so", "install libx11-6"),
            ("Unable to find a GPU! Make sure", "mesa-vulkan-drivers"),
            ("No supported formats for surface", "nothing here can draw a window (No supported formats"),
            ("index out of bounds", "the window is gone (index out of bounds)"),
        ] {
            let error = WindowError::of_panic(words.to_owned()).to_string();
            assert!(error.contains(kind), "{error}");
        }
    }
}

#[cfg(test)]
mod playlist_tests {
    use super::*;

    #[test]
    fn after_the_last_level_comes_the_first() {
        let mut playlist = Playlist::new("hard:3..5".parse().expect("a split"), 4);
        let mut levels = Vec::new();
        for _ in 0..4 {
            levels.push(playlist.current);
            playlist.advance();
        }
        assert_eq!(levels, [4, 5, 3, 4]);
    }
}
