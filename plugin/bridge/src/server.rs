//! Conversations with clients, one at a time.

use crate::{
    arrays::{Layout, Memory},
    lockstep::{Awaited, Leader, Lockstep, SavedEpisode, Settings, StepError, led_by, look_awake},
    messages::{Call, Hello, Kind, MOST_JSON, PROTOCOL, Refusal, Reset, read, write, write_json},
};
use bevy::prelude::World;
use bevy_playbot::{
    action::{ActionSpace, MixedSpace},
    demo::{
        file::{DemoHeader, DemoWriter},
        recorder::Recorder,
    },
    observation::Observation,
    prelude::{Recording, StateHash},
    vision::ImageOptions,
};
use playbot_harness::sensors::GameSensors;
use playbot_learner::{ObsKind, disk};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::{
    collections::BTreeMap,
    io::{self, ErrorKind, Read, Write},
    net::{SocketAddr, TcpListener, TcpStream},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{Sender, channel},
    },
    thread,
    time::Duration,
};
use thiserror::Error;

#[cfg(unix)]
use std::os::unix::net::{UnixListener, UnixStream};

/// The address at which clients are heard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// A socket in the file system, of this machine alone.
    #[cfg(unix)]
    Unix(PathBuf),
    /// A port of this machine's own address, such as 127.0.0.1:0, where 0 takes a free one.
    Tcp(SocketAddr),
}

/// There is no server.
#[derive(Debug, Error)]
pub enum ServeError {
    /// The address cannot be used.
    #[error("{address}: nobody can be heard there: {source}")]
    Listen {
        /// The address.
        address: String,
        /// The system's reason.
        source: io::Error,
    },
    /// The address can be reached from other machines.
    #[error(
        "{0} can be reached from other machines, and the protocol asks nobody who they are: take 127.0.0.1, and bring it to \
         other machines by `ssh -L`"
    )]
    NotLoopback(SocketAddr),
}

/// A socket at which clients are heard. Its file is removed at the end.
#[derive(Debug)]
pub struct Listener {
    kind: ListenerKind,
    /// The socket in the file system.
    path: Option<PathBuf>,
}

#[derive(Debug)]
enum ListenerKind {
    #[cfg(unix)]
    Unix(UnixListener),
    Tcp(TcpListener),
}

impl Listener {
    /// Begins to listen.
    ///
    /// # Errors
    ///
    /// The address is taken, is not of this machine alone, or there is none such.
    pub fn open(address: &Address) -> Result<Self, ServeError> {
        let kind = match address {
            #[cfg(unix)]
            Address::Unix(path) => {
                // The socket of a program that was killed is in the way, that of one that listens is not to be taken.
                let is_left =
                    UnixStream::connect(path).is_err_and(|error| error.kind() == ErrorKind::ConnectionRefused);
                if is_left {
                    let _ = disk::remove_file(path);
                }
                let refused = |source| ServeError::Listen { address: path.display().to_string(), source };
                ListenerKind::Unix(UnixListener::bind(path).map_err(refused)?)
            }
            Address::Tcp(address) => {
                if !address.ip().is_loopback() {
                    return Err(ServeError::NotLoopback(*address));
                }
                let refused = |source| ServeError::Listen { address: address.to_string(), source };
                ListenerKind::Tcp(TcpListener::bind(address).map_err(refused)?)
            }
        };
        let path = match address {
            #[cfg(unix)]
            Address::Unix(path) => Some(path.clone()),
            Address::Tcp(_) => None,
        };
        Ok(Self { kind, path })
    }

    /// Returns the address for clients: the path of the socket, or `127.0.0.1:PORT`.
    pub fn address(&self) -> String {
        match (&self.kind, &self.path) {
            (_, Some(path)) => path.display().to_string(),
            (ListenerKind::Tcp(listener), _) => {
                listener.local_addr().map_or_else(|_| String::new(), |at| at.to_string())
            }
            #[cfg(unix)]
            _ => String::new(),
        }
    }

    /// Returns the next client, if one is there already.
    fn client(&self) -> io::Result<Option<Stream>> {
        let accepted = match &self.kind {
            #[cfg(unix)]
            ListenerKind::Unix(listener) => {
                listener.set_nonblocking(true)?;
                listener.accept().and_then(|(stream, _)| stream.set_nonblocking(false).map(|()| Stream::Unix(stream)))
            }
            ListenerKind::Tcp(listener) => {
                listener.set_nonblocking(true)?;
                listener.accept().and_then(|(stream, _)| {
                    stream.set_nonblocking(false)?;
                    stream.set_nodelay(true)?;
                    Ok(Stream::Tcp(stream))
                })
            }
        };
        match accepted {
            Ok(stream) => Ok(Some(stream)),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::ConnectionAborted) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        if let Some(path) = &self.path {
            // Somebody else may have removed it.
            let _ = disk::remove_file(path);
        }
    }
}

/// The connection to a client.
#[derive(Debug)]
enum Stream {
    #[cfg(unix)]
    Unix(UnixStream),
    Tcp(TcpStream),
}

impl Stream {
    fn try_clone(&self) -> io::Result<Self> {
        Ok(match self {
            #[cfg(unix)]
            Self::Unix(stream) => Self::Unix(stream.try_clone()?),
            Self::Tcp(stream) => Self::Tcp(stream.try_clone()?),
        })
    }

    fn set_nonblocking(&self, nonblocking: bool) -> io::Result<()> {
        match self {
            #[cfg(unix)]
            Self::Unix(stream) => stream.set_nonblocking(nonblocking),
            Self::Tcp(stream) => stream.set_nonblocking(nonblocking),
        }
    }

    /// Ends the connection, also for a thread that waits for a message of it.
    fn close(&self) {
        // It may be over.
        let _ = match self {
            #[cfg(unix)]
            Self::Unix(stream) => stream.shutdown(std::net::Shutdown::Both),
            Self::Tcp(stream) => stream.shutdown(std::net::Shutdown::Both),
        };
    }
}

impl Read for Stream {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self {
            #[cfg(unix)]
            Self::Unix(stream) => stream.read(bytes),
            Self::Tcp(stream) => stream.read(bytes),
        }
    }
}

impl Write for Stream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            #[cfg(unix)]
            Self::Unix(stream) => stream.write(bytes),
            Self::Tcp(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A stream that is waited for [awake](look_awake) at first.
struct Awake<'a>(&'a mut Stream);

impl Read for Awake<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.0.set_nonblocking(true)?;
        let got = look_awake(|| match self.0.read(bytes) {
            Err(error) if error.kind() == ErrorKind::WouldBlock => None,
            got => Some(got),
        });
        self.0.set_nonblocking(false)?;
        got.unwrap_or_else(|| self.0.read(bytes))
    }
}

/// Time between two looks for a client, or for a request to stop.
const LOOK: Duration = Duration::from_millis(20);

/// Looks for which a second client waits for the end of the first one: it may be leaving.
const PATIENCE: u32 = 25;

/// Looks for the only client, about a minute: whoever has started the server for it is gone.
const MOST_LOOKS: u32 = 3000;

/// A server.
pub struct Server<'a> {
    /// What is played.
    pub settings: &'a Settings<'a>,
    /// Whether arrays lie in shared memory.
    pub shared: bool,
    /// End with the first client.
    pub once: bool,
    /// Asked now and then whether to stop.
    pub stops: &'a (dyn Fn() -> bool + Sync),
    /// Gets a line for each thing that happens.
    pub report: &'a (dyn Fn(&str) + Sync),
}

impl Server<'_> {
    /// Talks with one client after the other. A second one at the same time is refused.
    ///
    /// # Errors
    ///
    /// No client can be heard any more.
    pub fn run(&self, listener: &Listener) -> io::Result<()> {
        let (mut looks, mut early) = (0, None);
        while !(self.stops)() {
            let Some(stream) = early.take().map_or_else(|| listener.client(), |stream| Ok(Some(stream)))? else {
                thread::park_timeout(LOOK);
                looks += 1;
                if self.once && looks > MOST_LOOKS {
                    (self.report)("no client has come, and only one was waited for");
                    break;
                }
                continue;
            };
            let other = stream.try_clone().ok();
            let over = AtomicBool::new(false);
            let ended = thread::scope(|scope| {
                let watching = scope.spawn(|| self.watch(listener, other.as_ref(), &over));
                let ended = self.converse(stream);
                over.store(true, Ordering::Release);
                early = watching.join().unwrap_or_default();
                ended
            });
            (self.report)(&ended);
            if self.once {
                break;
            }
        }
        Ok(())
    }

    /// Refuses other clients, and ends the conversation if it has to stop. Returns a client that has come just before the
    /// end, which is the next one.
    fn watch(&self, listener: &Listener, stream: Option<&Stream>, over: &AtomicBool) -> Option<Stream> {
        let mut second: Option<(Stream, u32)> = None;
        while !over.load(Ordering::Acquire) {
            if (self.stops)() {
                stream.inspect(|stream| stream.close());
            }
            if second.is_none() {
                second = listener.client().ok().flatten().map(|stream| (stream, 0));
            }
            let waited = second.as_mut().map_or(0, |(_, looks)| {
                *looks += 1;
                *looks
            });
            if waited > PATIENCE
                && let Some((mut second, _)) = second.take()
            {
                let words = "another client is connected, and a server has one at a time: start a server of your own";
                // It may be gone again.
                let _ = write_json(&mut second, Kind::Error, &Refusal::fatal(words));
                second.close();
            }
            thread::park_timeout(LOOK);
        }
        second.map(|(stream, _)| stream)
    }

    /// Talks with a client until it leaves, and returns how that went, in words.
    fn converse(&self, mut stream: Stream) -> String {
        let client = match self.greet(&mut stream) {
            Ok(client) => client,
            Err(why) => return refuse(&mut stream, Refusal::fatal(why)),
        };
        let layout = self.settings.layout();
        let memory = match self.memory(layout) {
            Ok(memory) => Arc::new(memory),
            Err(why) => return refuse(&mut stream, Refusal::fatal(why)),
        };
        let (ended, ends) = channel();
        let conversation = Conversation {
            stream,
            memory: memory.clone(),
            description: describe(self.settings, &memory),
            header: self.settings.game.demo_header(&self.settings.levels.mode),
            picture: self.picture(),
            pending: None,
            saved: BTreeMap::new(),
            next: 0,
            steps: 0,
            ended,
        };
        (self.report)(&format!("{client} is connected"));
        led_by(self.settings, &memory, conversation);
        // The conversation is over, and has said how.
        let how = ends.try_iter().last().unwrap_or_else(|| "has left".to_owned());
        if (self.stops)() { format!("stopped: {client} hears no more") } else { format!("{client} {how}") }
    }

    /// Returns the form of the pictures for people, if there are any.
    fn picture(&self) -> Option<ImageOptions> {
        let Settings { observation, picture, .. } = self.settings;
        if observation.is_image() { Some(observation.image) } else { *picture }
    }

    #[cfg(unix)]
    fn memory(&self, layout: Layout) -> Result<Memory, String> {
        match self.shared {
            true => Memory::shared(layout, PROTOCOL).map_err(|error| error.to_string()),
            false => Ok(Memory::of_messages(layout)),
        }
    }

    #[cfg(not(unix))]
    fn memory(&self, layout: Layout) -> Result<Memory, String> {
        Ok(Memory::of_messages(layout))
    }

    /// Reads the first message, and returns the name of the client, or why it cannot be served.
    fn greet(&self, stream: &mut Stream) -> Result<String, String> {
        let first = read(stream, MOST_JSON).map_err(|error| format!("this is no client: {error}"))?;
        let Some((Kind::Hello, content)) = first else {
            return Err("a client says hello first, with the version of its protocol".to_owned());
        };
        let hello: Hello = parse(&content)?;
        if hello.protocol != PROTOCOL {
            return Err(format!(
                "the client {} speaks version {} of the protocol, and this program version {PROTOCOL}: take the client of \
                 playbot {}",
                hello.client,
                hello.protocol,
                env!("CARGO_PKG_VERSION")
            ));
        }
        Ok(if hello.client.is_empty() { "a client".to_owned() } else { hello.client })
    }
}

/// Sends a refusal, and returns its words.
fn refuse(stream: &mut Stream, refusal: Refusal) -> String {
    // It may be gone.
    let _ = write_json(stream, Kind::Error, &refusal);
    refusal.error
}

fn parse<T: DeserializeOwned>(content: &[u8]) -> Result<T, String> {
    serde_json::from_slice(content).map_err(|error| format!("the content of a message is not as expected: {error}"))
}

/// Returns the answer to a hello: game, levels, spaces and arrays.
fn describe(settings: &Settings<'_>, memory: &Memory) -> Value {
    let game = settings.game;
    let tools = game.tools();
    let layout = memory.layout();
    let observation = match settings.observation.obs_kind(game) {
        ObsKind::Vector(_) => json!({ "kind": "vector", "names": game.observation().names }),
        ObsKind::Image(shape) => {
            json!({ "kind": "image", "shape": [shape.channels, shape.height, shape.width], "image": settings.observation.image })
        }
    };
    let names = tools.input.action_names();
    let action = match game.actions() {
        ActionSpace::Discrete(count) => json!({ "kind": "discrete", "count": count, "names": names }),
        ActionSpace::Continuous(count) => {
            json!({ "kind": "continuous", "count": count, "low": -1.0, "high": 1.0, "names": names })
        }
        ActionSpace::Mixed(MixedSpace { choices, numbers }) => json!({
            "kind": "mixed", "choices": choices.sizes(), "numbers": numbers, "low": -1.0, "high": 1.0, "names": names,
        }),
    };
    json!({
        "protocol": PROTOCOL, "version": env!("CARGO_PKG_VERSION"), "game": game.name(), "game_version": game.version(),
        "mode": settings.levels.mode, "levels": settings.levels.to_string(), "order": settings.order,
        "tick_hz": game.tick_hz(), "time_limit": tools.host.time_limit(), "arenas": settings.arenas,
        "agents": layout.actions.first().map_or(0, |array| array.shape[0]),
        "agents_per_arena": settings.agents_per_arena(), "seats": tools.host.seats(), "autoreset": settings.autoreset,
        "observation": observation, "action": action,
        "picture": settings.picture.map(|image| [image.height, image.width]),
        "memory": memory.path().map(|path| json!({ "path": path, "bytes": layout.bytes() })),
        "layout": layout, "checksum": layout.checksum(),
    })
}

/// A conversation after the greeting.
struct Conversation {
    stream: Stream,
    memory: Arc<Memory>,
    /// The answer to the client's hello, which is given once the Worlds are there.
    description: Value,
    header: DemoHeader,
    picture: Option<ImageOptions>,
    /// What the client waits for.
    pending: Option<Pending>,
    saved: BTreeMap<u64, Vec<SavedEpisode>>,
    next: u64,
    steps: u64,
    /// Gets the words for how it has ended.
    ended: Sender<String>,
}

/// A request that Worlds work on.
enum Pending {
    State,
    Hash(Awaited<Option<StateHash>>),
    Save(usize, Awaited<Option<Vec<SavedEpisode>>>),
    Render(Awaited<Option<Observation>>),
    Record(Vec<PathBuf>, Vec<Awaited<()>>),
    /// Nothing: the answer is known.
    Known(Value),
}

/// An answer to a request.
enum Answer {
    Json(Value),
    Bytes(Vec<u8>),
    State(usize),
}

impl Leader for Conversation {
    fn lead(&mut self, worlds: &mut Lockstep) -> bool {
        match self.proceed(worlds) {
            Ok(goes_on) => goes_on,
            Err(error) => self.end(&error.to_string()),
        }
    }

    fn fail(&mut self, why: &str) {
        // It may be gone.
        let _ = self.refuse(&Refusal::fatal(why));
        self.end(why);
    }
}

impl Conversation {
    /// Answers the last request, and takes the next one. Returns false when the client has left.
    fn proceed(&mut self, worlds: &mut Lockstep) -> io::Result<bool> {
        match self.pending.take().map(|pending| self.finish(pending, worlds)) {
            // The Worlds are there.
            None => write_json(&mut self.stream, Kind::Hello, &self.description)?,
            Some(answered) => self.answer(answered)?,
        }
        let most = MOST_JSON.max(self.memory.layout().action_bytes);
        loop {
            let (kind, content) = match read(&mut Awake(&mut self.stream), most) {
                Ok(Some(message)) => message,
                Ok(None) => return Ok(self.leave()),
                Err(error) if error.kind() == ErrorKind::InvalidData => {
                    // Where the next message begins is not known.
                    self.refuse(&Refusal::fatal(error.to_string()))?;
                    return Err(error);
                }
                Err(error) => return Err(error),
            };
            let begun = match kind {
                Kind::Step => self.step(&content, worlds).inspect(|_| self.steps += 1),
                Kind::Reset => parse(&content)
                    .map_err(refused)
                    .and_then(|reset: Reset| worlds.begin_reset(&reset))
                    .map(|()| Pending::State),
                Kind::Call => parse(&content).map_err(refused).and_then(|call| self.call(call, worlds)),
                Kind::Close => return Ok(self.leave()),
                _ => Err(refused(format!("a client sends no message of kind {}", kind as u8))),
            };
            match begun {
                Ok(Pending::Known(answer)) => self.answer(Ok(Answer::Json(answer)))?,
                Ok(pending) => {
                    self.pending = Some(pending);
                    return Ok(true);
                }
                Err(error) => self.answer(Err(error))?,
            }
        }
    }

    fn leave(&mut self) -> bool {
        self.end(&format!("after {} steps", self.steps))
    }

    /// Notes how the conversation has ended. Returns false.
    fn end(&mut self, how: &str) -> bool {
        // The server waits for it.
        let _ = self.ended.send(format!("has left: {how}"));
        self.stream.close();
        false
    }

    fn answer(&mut self, answered: Result<Answer, StepError>) -> io::Result<()> {
        match answered {
            Ok(Answer::State(slot)) => {
                let slot = [u8::try_from(slot).unwrap_or_default()];
                let Self { memory, stream, .. } = self;
                memory.with_results(|results| write(stream, Kind::State, &[&slot, results]))
            }
            Ok(Answer::Json(answer)) => write_json(&mut self.stream, Kind::Answer, &answer),
            Ok(Answer::Bytes(bytes)) => write(&mut self.stream, Kind::Bytes, &[&bytes]),
            Err(StepError::Refused(refusal)) => self.refuse(&refusal),
            Err(StepError::Failed(why)) => {
                self.refuse(&Refusal::fatal(why.clone()))?;
                Err(io::Error::other(why))
            }
        }
    }

    fn refuse(&mut self, refusal: &Refusal) -> io::Result<()> {
        write_json(&mut self.stream, Kind::Error, refusal)
    }

    fn step(&self, content: &[u8], worlds: &mut Lockstep) -> Result<Pending, StepError> {
        let wanted = if self.memory.is_shared() { 0 } else { self.memory.layout().action_bytes };
        if content.len() != wanted {
            let words = format!(
                "a step has {} bytes of actions, and {wanted} are expected: the arrays are those of `layout.actions`",
                content.len()
            );
            return Err(refused(words));
        }
        self.memory.take_actions(content);
        worlds.begin_step().map(|()| Pending::State)
    }

    fn call(&mut self, call: Call, worlds: &mut Lockstep) -> Result<Pending, StepError> {
        match call {
            Call::Mapped => {
                self.memory.forget_path();
                Ok(Pending::Known(json!({})))
            }
            Call::Hash { arena } => {
                let hash = |world: &mut World, agent| world.get::<StateHash>(agent).copied();
                worlds.begin_call(arena, hash).map(Pending::Hash)
            }
            Call::Save { arena } => worlds.begin_save(arena).map(|saved| Pending::Save(arena, saved)),
            Call::Load { arena, saved } => {
                let saved = self.saved.get(&saved).cloned().ok_or_else(|| unknown(saved))?;
                worlds.begin_load(arena, saved).map(|()| Pending::State)
            }
            Call::Forget { saved } => match self.saved.remove(&saved) {
                Some(_) => Ok(Pending::Known(json!({}))),
                None => Err(unknown(saved)),
            },
            Call::Render { arena } => {
                if self.picture.is_none() {
                    let words = "there are no pictures: start the server with --render 256, or another size";
                    return Err(refused(words.to_owned()));
                }
                let seen = |world: &mut World, agent| world.get::<Observation>(agent).cloned();
                worlds.begin_call(arena, seen).map(Pending::Render)
            }
            Call::Record { folder } => self.record(Path::new(&folder), worlds),
        }
    }

    /// Begins to record all Worlds, a file each.
    fn record(&self, folder: &Path, worlds: &mut Lockstep) -> Result<Pending, StepError> {
        let failed = |path: &Path, why: String| refused(format!("{}: {why}", path.display()));
        worlds.check_begun()?;
        disk::create_dir_all(folder).map_err(|error| failed(folder, error.to_string()))?;
        let path = |world| folder.join(format!("world-{world:03}.demo"));
        let files: Vec<PathBuf> = (0..worlds.worlds()).map(path).collect();
        let mut writers = Vec::new();
        for path in &files {
            let header = DemoHeader { demonstrator: "client".to_owned(), ..self.header.clone() };
            writers.push(Some(DemoWriter::create(path, header).map_err(|error| failed(path, error.to_string()))?));
        }
        let writers = Arc::new(Mutex::new(writers));
        let begun = worlds.begin_calls(move |number, world, agents| {
            let Some(writer) = writers.lock().unwrap_or_else(PoisonError::into_inner)[number].take() else { return };
            world.insert_resource(Recorder::new(writer));
            for &agent in agents {
                world.entity_mut(agent).insert(Recording::default());
            }
        })?;
        Ok(Pending::Record(files, begun))
    }

    /// Returns the answer to a request that the Worlds have worked on.
    fn finish(&mut self, pending: Pending, worlds: &Lockstep) -> Result<Answer, StepError> {
        Ok(match pending {
            Pending::State => Answer::State(worlds.slot()),
            Pending::Known(answer) => Answer::Json(answer),
            Pending::Hash(hash) => {
                let hash = hash.answer()?.unwrap_or_default();
                Answer::Json(json!({ "hash": format!("{:016x}", hash.0) }))
            }
            Pending::Save(arena, saved) => {
                let over = || format!("the episode of arena {arena} is over: nothing can be kept of it");
                let saved = saved.answer()?.ok_or_else(|| StepError::Refused(Refusal::of_arena(arena, over())))?;
                self.next += 1;
                self.saved.insert(self.next, saved);
                Answer::Json(json!({ "saved": self.next }))
            }
            Pending::Render(seen) => {
                let seen = seen.answer()?.unwrap_or_default();
                Answer::Bytes(self.picture.map(|image| by_pixels(&image, &seen.image)).unwrap_or_default())
            }
            Pending::Record(files, begun) => {
                begun.into_iter().try_for_each(Awaited::answer)?;
                Answer::Json(json!({ "files": files }))
            }
        })
    }
}

fn refused(words: String) -> StepError {
    StepError::Refused(Refusal::new(words))
}

fn unknown(saved: u64) -> StepError {
    refused(format!("nothing is kept under the number {saved}"))
}

/// Returns the newest picture of an observation `[channels, height, width]` as `[height, width, 3]`.
pub(crate) fn by_pixels(image: &ImageOptions, planes: &[u8]) -> Vec<u8> {
    let plane = (image.width * image.height) as usize;
    let colours = image.colours() as usize;
    let newest = &planes[planes.len().saturating_sub(colours * plane)..];
    if newest.len() < colours * plane {
        return vec![0; 3 * plane];
    }
    let pixel = |at: usize| [0, 1, 2].map(|colour| newest[(colour % colours) * plane + at]);
    (0..plane).flat_map(pixel).collect()
}
