//! The plugin that lets a person take over.

use bevy::{input::InputSystems, prelude::*};

use super::{
    error::TakeoverError,
    identity::GameIdentity,
    play_policy,
    play_replay::{self, Playing},
    record,
    request::{RequestError, TakeoverRequest},
    seats::{Seat, playing_agents},
};
use crate::{
    fault::{FaultSystems, Faults},
    keyboard::note_taps,
    systems::PlaybotSystems,
};

/// The environment variable that holds the request.
const VARIABLE: &str = "PLAYBOT";

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
}

impl TakeoverPlugin {
    /// Creates the plugin for this game, with F9 and the request of the environment.
    pub fn new(game: GameIdentity) -> Self {
        let request = std::env::var_os(VARIABLE).filter(|text| !text.is_empty());
        Self { game, key: Some(KeyCode::F9), request: request.map(|text| text.to_string_lossy().parse()) }
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
        app.insert_resource(self.game.clone())
            .insert_resource(Takeover { request, key: self.key, is_wanted, error, running: Running::Nothing })
            // Runs before keys are noted, so that the person's keys no longer act in the frame of
            // the takeover.
            .add_systems(PreUpdate, (hear_key, take_over).chain().after(InputSystems).before(note_taps))
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
    key: Option<KeyCode>,
    /// True if it is to go on.
    is_wanted: bool,
    /// The error of the request, until it is reported.
    #[reflect(ignore)]
    error: Option<RequestError>,
    #[reflect(ignore)]
    running: Running,
}

#[derive(Debug, Default)]
enum Running {
    #[default]
    Nothing,
    Recording,
    Policy(Vec<Seat>),
    Replay(Box<Playing>),
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

fn hear_key(keys: Option<Res<ButtonInput<KeyCode>>>, mut takeover: ResMut<Takeover>) {
    let Some(key) = takeover.key else { return };
    if keys.is_some_and(|keys| keys.just_pressed(key)) {
        takeover.is_wanted = !takeover.is_wanted;
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
        TakeoverRequest::Record(path) => record::start(world, path).map(|()| Running::Recording),
        TakeoverRequest::Policy(path) => play_policy::start(world, path).map(Running::Policy),
        TakeoverRequest::Replay(path) => play_replay::start(world, path)
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
        Running::Recording => record::stop(world),
        Running::Policy(seats) => {
            play_policy::stop(world, seats);
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
    if matches!(world.resource::<Takeover>().running, Running::Recording) {
        world.resource_mut::<Takeover>().is_wanted = false;
        stop(world);
    }
}
