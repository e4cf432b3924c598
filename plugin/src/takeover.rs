//! Taking over a shipped build: recording testers, letting a policy play, replaying a recording, without another
//! program.
//!
//! A game with [`PlaybotPlugins`](crate::plugin::PlaybotPlugins) reads the environment variable
//! `PLAYBOT` when it starts:
//!
//! ```text
//! PLAYBOT=record:ada.demo ./game       record every episode of the agents that play
//! PLAYBOT=policy:walker.policy ./game  a policy plays instead
//! PLAYBOT=replay:ada.demo ./game       a recording plays instead
//! ```
//!
//! F9, or the key of [`TakeoverPlugin::key`], stops and restarts it. Without `PLAYBOT` the key
//! starts a recording named for the game. An existing recording is continued, and
//! [`merge_demos`](crate::demo::file::merge_demos) joins those of many testers. `PLAYBOT_NAME`
//! names the player.
//!
//! F10 learns from the recording, in another program, and Tab hands over to what it has learned so far: set
//! `PLAYBOT_TEACH` to the program with playbot's verbs and this game, see [`lesson`](crate::lesson). It plays better
//! while you watch.
//!
//! ```text
//! PLAYBOT_TEACH=target/release/bots ./game   F9 records you, F10 learns from it, Tab hands over
//! ```
//!
//! The folder: `play` has the three takeovers and the former players of the agents, `teach` has the lesson.
//!
//! An impossible request triggers a [`FaultOccurred`](crate::fault::FaultOccurred), and the game
//! goes on unchanged. A World that is ticked by hand, as in training, cannot be taken over.
//!
//! ```
//! use bevy_playbot::takeover::TakeoverRequest;
//!
//! let request: TakeoverRequest = "record:ada.demo".parse().expect("valid");
//! assert_eq!(request, TakeoverRequest::Record("ada.demo".into()));
//! let error = "rekord:ada.demo".parse::<TakeoverRequest>().expect_err("no such way").to_string();
//! assert!(error.contains("did you mean `record`?"));
//! ```

mod play;
mod teach;

use crate::{
    demo::file::DemoFileError,
    fault::{FaultSystems, Faults},
    key_bindings::note_taps,
    systems::PlaybotSystems,
    takeover::play::{Playing, Seat, playing_agents},
    unknown_name::nearest,
};
use bevy::{input::InputSystems, prelude::*};
use playbot_learner::FileError;
use std::{fmt, path::PathBuf, str::FromStr};
use thiserror::Error;

pub use crate::takeover::teach::{TeachOptions, Teaching};

/// The environment variable that holds the request.
const VARIABLE: &str = "PLAYBOT";

const WAYS: [&str; 3] = ["record", "policy", "replay"];

/// Lets a person take over by the environment variable `PLAYBOT` and a key: see [the
/// module](super).
#[derive(Clone, Debug)]
pub struct TakeoverPlugin {
    /// The identity of the game.
    pub game: GameIdentity,
    /// The key that stops and restarts it; `None` for no key.
    pub key: Option<KeyCode>,
    /// The request at the start. [`new`](Self::new) reads it from the environment.
    pub request: Option<Result<TakeoverRequest, RequestError>>,
    /// The program that learns from the recording, and its keys.
    pub teach: TeachOptions,
}

impl TakeoverPlugin {
    /// Creates the plugin for this game, with F9 and the request of the environment.
    pub fn new(game: GameIdentity) -> Self {
        let request = std::env::var_os(VARIABLE).filter(|text| !text.is_empty());
        let request = request.map(|text| text.to_string_lossy().parse());
        Self { game, key: Some(KeyCode::F9), request, teach: TeachOptions::default() }
    }

    /// Sets the request at the start, in place of the environment's.
    pub fn with_request(mut self, request: TakeoverRequest) -> Self {
        self.request = Some(Ok(request));
        self
    }
}

impl Plugin for TakeoverPlugin {
    fn build(&self, app: &mut App) {
        let recording = TakeoverRequest::Record(format!("{}.demo", self.game.name).into());
        let (request, is_wanted, error) = match self.request.clone() {
            Some(Ok(request)) => (request, true, None),
            Some(Err(error)) => (recording, false, Some(error)),
            None => (recording, false, None),
        };
        let recorded = match &request {
            TakeoverRequest::Record(path) => Some(path.clone()),
            TakeoverRequest::Policy(_) | TakeoverRequest::Replay(_) => None,
        };
        app.insert_resource(self.game.clone())
            .insert_resource(Teaching::new(self.teach.clone()))
            .insert_resource(Takeover {
                first: request.clone(),
                request,
                recording: recorded,
                key: self.key,
                is_wanted,
                error,
                running: Running::Nothing,
            })
            // Runs before keys are noted, so that the person's keys no longer act in the frame of
            // the takeover.
            .add_systems(PreUpdate, (hear_key, teach::teach, take_over).chain().after(InputSystems).before(note_taps))
            .add_systems(
                Last,
                // Errors of the last episode are still reported.
                finish.after(PlaybotSystems::Reset).before(FaultSystems).run_if(on_message::<AppExit>),
            );
    }
}

/// The state of a takeover.
#[derive(Resource, Debug, Reflect)]
#[reflect(Resource)]
pub struct Takeover {
    request: TakeoverRequest,
    /// The request of the key.
    first: TakeoverRequest,
    /// The recording that a lesson learns from, if the key records.
    recording: Option<PathBuf>,
    key: Option<KeyCode>,
    /// True if it is to go on.
    is_wanted: bool,
    /// The error of the request, until it is reported.
    #[reflect(ignore)]
    error: Option<RequestError>,
    #[reflect(ignore)]
    running: Running,
}

impl Takeover {
    /// Returns the request that is running, or that the key would start.
    pub fn request(&self) -> &TakeoverRequest {
        &self.request
    }

    /// Returns whether it is running.
    pub fn is_running(&self) -> bool {
        !matches!(self.running, Running::Nothing)
    }

    fn is_recording(&self) -> bool {
        matches!(self.running, Running::Recording)
    }

    /// Starts a request, in place of the running one, as soon as an agent plays.
    pub fn start(&mut self, request: TakeoverRequest) {
        self.is_wanted = true;
        self.request = request;
    }

    /// Gives the agents back before the next tick.
    pub fn stop(&mut self) {
        self.is_wanted = false;
    }
}

#[derive(Debug, Default)]
enum Running {
    #[default]
    Nothing,
    Recording,
    Policy(Vec<Seat>),
    Replay(Box<Playing>),
}

fn hear_key(keys: Option<Res<ButtonInput<KeyCode>>>, mut takeover: ResMut<Takeover>) {
    let Some(key) = takeover.key else { return };
    if keys.is_some_and(|keys| keys.just_pressed(key)) {
        // A policy may have taken over since.
        let is_first = takeover.request == takeover.first;
        takeover.is_wanted = !(is_first && takeover.is_wanted);
        takeover.request = takeover.first.clone();
    }
}

/// Starts, continues and stops, between two ticks.
fn take_over(world: &mut World, mut doing: Local<Option<TakeoverRequest>>) {
    if world.resource::<Faults>().has_caller() {
        return;
    }
    if let Some(error) = world.resource_mut::<Takeover>().error.take() {
        world.resource_mut::<Faults>().report(TakeoverError::from(error).to_string());
    }
    let takeover = world.resource::<Takeover>();
    let is_other = doing.as_ref().is_some_and(|doing| *doing != takeover.request);
    if takeover.is_running() && (!takeover.is_wanted || is_other) {
        stop(world);
    }
    let takeover = world.resource::<Takeover>();
    if !takeover.is_running() && takeover.is_wanted {
        // Before the first tick no agent plays.
        if !playing_agents(world).is_empty() {
            *doing = Some(takeover.request.clone());
            start(world);
        }
        return;
    }
    let mut running = std::mem::take(&mut world.resource_mut::<Takeover>().running);
    let goes_on = match &mut running {
        Running::Replay(playing) => playing.go_on(world),
        _ => true,
    };
    let mut takeover = world.resource_mut::<Takeover>();
    takeover.running = running;
    if !goes_on {
        takeover.is_wanted = false;
        stop(world);
    }
}

fn start(world: &mut World) {
    let request = world.resource::<Takeover>().request.clone();
    let started = match &request {
        TakeoverRequest::Record(path) => play::start_recording(world, path).map(|()| Running::Recording),
        TakeoverRequest::Policy(path) => play::start(world, path).map(Running::Policy),
        TakeoverRequest::Replay(path) => play::start_replay(world, path)
            .map(|playing| playing.map_or(Running::Nothing, |playing| Running::Replay(Box::new(playing)))),
    };
    match started {
        Ok(running) => {
            tracing::info!("{request}");
            world.resource_mut::<Takeover>().running = running;
        }
        Err(error) => {
            world.resource_mut::<Takeover>().is_wanted = false;
            world.resource_mut::<Faults>().report(format!("{request}: {error}"));
        }
    }
}

fn stop(world: &mut World) {
    let running = std::mem::take(&mut world.resource_mut::<Takeover>().running);
    let stopped = match running {
        Running::Nothing => Ok(()),
        Running::Recording => play::stop_recording(world),
        Running::Policy(seats) => {
            play::stop(world, seats);
            Ok(())
        }
        Running::Replay(playing) => {
            playing.stop(world);
            Ok(())
        }
    };
    if let Err(error) = stopped {
        world.resource_mut::<Faults>().report(error.to_string());
    }
}

/// Finishes a recording when the game ends.
fn finish(world: &mut World) {
    if world.resource::<Takeover>().is_recording() {
        world.resource_mut::<Takeover>().is_wanted = false;
        stop(world);
    }
}

/// The request of a takeover; in text `record:FILE`, `policy:FILE` or `replay:FILE`.
#[derive(Clone, Debug, PartialEq, Eq, Reflect)]
pub enum TakeoverRequest {
    /// Record every episode of the agents that play, into this file.
    Record(PathBuf),
    /// Let this policy play.
    Policy(PathBuf),
    /// Let this recording play, one episode after the other.
    Replay(PathBuf),
}

/// The text is not a valid request.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum RequestError {
    /// The verb does not exist.
    #[error(
        "`{text}` is not a valid request{}; valid: record:FILE, policy:FILE, replay:FILE",
        .near.as_ref().map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"))
    )]
    Unknown {
        /// The text.
        text: String,
        /// The nearest verb.
        near: Option<String>,
    },
    /// The file is missing.
    #[error("`{way}:` names no file; write {way}:FILE")]
    NoFile {
        /// The verb.
        way: &'static str,
    },
}

impl FromStr for TakeoverRequest {
    type Err = RequestError;

    fn from_str(text: &str) -> Result<Self, RequestError> {
        let (name, file) = text.split_once(':').unwrap_or((text, ""));
        let Some(way) = WAYS.into_iter().find(|way| *way == name) else {
            let near = nearest(name, &WAYS).map(str::to_owned);
            return Err(RequestError::Unknown { text: text.to_owned(), near });
        };
        if file.is_empty() {
            return Err(RequestError::NoFile { way });
        }
        Ok(match way {
            "record" => Self::Record(file.into()),
            "policy" => Self::Policy(file.into()),
            _ => Self::Replay(file.into()),
        })
    }
}

impl fmt::Display for TakeoverRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Record(file) => write!(f, "record:{}", file.display()),
            Self::Policy(file) => write!(f, "policy:{}", file.display()),
            Self::Replay(file) => write!(f, "replay:{}", file.display()),
        }
    }
}

/// The reason why a takeover failed.
#[derive(Debug, Error)]
pub enum TakeoverError {
    /// The request cannot be understood.
    #[error("PLAYBOT: {0}")]
    Request(#[from] RequestError),
    /// The recording cannot be read, written or continued, or belongs to another game.
    #[error(transparent)]
    Demo(#[from] DemoFileError),
    /// The policy cannot be read.
    #[error(transparent)]
    Policy(#[from] FileError),
    /// The policy was made for another game, other actions or another observation.
    #[error("{}: {why}", path.display())]
    Misfit {
        /// Path of the policy.
        path: PathBuf,
        /// The difference.
        why: String,
    },
    /// The game records by itself.
    #[error("this game records already; it cannot record into {} as well", path.display())]
    Recording {
        /// Path of the file that was asked for.
        path: PathBuf,
    },
    /// There is no episode to play.
    #[error("{}: the recording holds no episode that could be played", path.display())]
    Empty {
        /// Path of the recording.
        path: PathBuf,
    },
}

/// The identity of this game. Recordings carry it, and policies and recordings of another game are
/// refused.
///
/// ```
/// use bevy_playbot::takeover::GameIdentity;
///
/// let game = GameIdentity::new("breakout", 3).with_mode("endless");
/// assert_eq!((game.version, game.mode.as_str()), (3, "endless"));
/// ```
#[derive(Resource, Clone, Debug, PartialEq, Eq, Reflect)]
#[reflect(Resource)]
pub struct GameIdentity {
    /// Name of the game.
    pub name: String,
    /// Version of its rules: raise it whenever an old recording would no longer replay.
    pub version: u32,
    /// Mode, such as a difficulty; `default` unless the game says otherwise.
    pub mode: String,
}

/// The mode of a game that has only one.
const DEFAULT_MODE: &str = "default";

impl GameIdentity {
    /// Creates a game in its only mode.
    pub fn new(name: &str, version: u32) -> Self {
        Self { name: name.to_owned(), version, mode: DEFAULT_MODE.to_owned() }
    }

    /// Returns the same game in another mode.
    pub fn with_mode(mut self, mode: &str) -> Self {
        self.mode = mode.to_owned();
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_read_back_and_files_may_have_colons() {
        for text in ["record:a.demo", "policy:b/c.policy", "replay:C:\\d.demo"] {
            assert_eq!(text.parse::<TakeoverRequest>().expect("valid").to_string(), text);
        }
    }

    #[test]
    fn what_cannot_be_done_is_refused_with_what_can() {
        for (text, words) in [
            ("polic:x", "did you mean `policy`?"),
            ("x", "valid: record:FILE, policy:FILE, replay:FILE"),
            ("", "valid: record:FILE"),
            ("record", "`record:` names no file"),
            ("replay:", "`replay:` names no file; write replay:FILE"),
        ] {
            let error = text.parse::<TakeoverRequest>().expect_err(text).to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
