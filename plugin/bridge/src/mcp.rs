//! Sessions of a language model that plays a game as a tester, over the Model Context Protocol.
//!
//! The model's client starts the program and speaks JSON-RPC over its standard input and output, a message a line. Six tools
//! look at the game, play it, and ask its detectors. No model is called here, and nothing moves between two calls.
//!
//! ```
//! use bevy::prelude::*;
//! use playbot_bridge::{lockstep::{Autoreset, LevelOrder, Settings}, mcp::{Bounds, NoExaminer, Server}};
//! use playbot_harness::{foreign::ForeignGame, prelude::*};
//!
//! let game = ForeignGame::new("wait", 1, |_: &mut App| {})
//!     .keys([vec![], vec![KeyCode::Space]])
//!     .observe(["time"], |time: Res<Time>| [time.elapsed_secs()])
//!     .time_limit(5);
//! let settings = Settings {
//!     game: &game,
//!     levels: "default:0..9".parse().expect("a range"),
//!     order: LevelOrder::Rounds,
//!     observation: Default::default(),
//!     picture: None,
//!     arenas: 1,
//!     threads: 1,
//!     seed: 1,
//!     autoreset: Autoreset::Disabled,
//!     first_seat: false,
//! };
//! let folder = tempfile::tempdir().expect("a folder");
//! let server = Server {
//!     settings: &settings,
//!     bounds: Bounds::default(),
//!     folder: folder.path(),
//!     examiner: &NoExaminer,
//!     stops: &|| false,
//!     report: &|_| {},
//! };
//! let said = [
//!     r#"{"jsonrpc":"2.0","id":1,"method":"initialize","params":{"protocolVersion":"2025-06-18"}}"#,
//!     r#"{"jsonrpc":"2.0","id":2,"method":"tools/call","params":{"name":"reset","arguments":{"level":3}}}"#,
//!     r#"{"jsonrpc":"2.0","id":3,"method":"tools/call","params":{"name":"act","arguments":{"action":"Space","ticks":9}}}"#,
//! ];
//! let mut answers = Vec::new();
//! let ended = server.run(std::io::Cursor::new(said.join("\n")), &mut answers).expect("a thread");
//! assert_eq!((ended.episodes, ended.ticks), (1, 5));
//! assert!(folder.path().join("session.demo").is_file());
//! assert_eq!(String::from_utf8(answers).expect("text").lines().count(), 3);
//! ```
//!
//! The files of the folder, in reading order:
//!
//! - `protocol`: messages.
//! - `tools`: the tools as a model reads them.
//! - `words`: actions, observations and pictures, and the seats of several agents.
//! - `episodes`: levels by name, and episodes, their recordings and their replay.
//! - `session`: the work of the tools.

mod episodes;
mod protocol;
mod session;
mod tools;
mod words;

use crate::{
    arrays::Memory,
    lockstep::{Settings, with_worlds},
    mcp::{
        protocol::Inbox,
        session::{Pause, Session},
    },
};
use std::{
    fmt,
    io::{self, Read, Write},
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

pub use crate::mcp::episodes::{PlayedAgent, PlayedEpisode};

/// The bounds of a session. Beyond them it can still be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bounds {
    /// Most ticks of the session.
    pub ticks: u64,
    /// Longest time of the session.
    pub time: Duration,
    /// Most ticks of a call.
    pub ticks_per_call: u64,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { ticks: 10_000, time: Duration::from_secs(1800), ticks_per_call: 600 }
    }
}

/// A finding in an episode.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundInEpisode {
    /// The detector.
    pub detector: String,
    /// The tick, from 0; `None` if the finding needs no play.
    pub tick: Option<u32>,
    /// The message.
    pub message: String,
    /// The file that replays it, or why there is none.
    pub file: Result<PathBuf, String>,
}

/// Detectors that look at the episodes of a session. They lie in another crate, which knows findings as files.
pub trait Examiner {
    /// Plays an episode again with all detectors, and stores what they find. `tester` is the name of the client.
    ///
    /// # Errors
    ///
    /// Nothing can be stored, in words.
    fn examine(&self, episode: &PlayedEpisode, tester: &str) -> Result<Vec<FoundInEpisode>, String>;

    /// Stores a finding of the model's own, which shows after this tick of the episode.
    ///
    /// # Errors
    ///
    /// It cannot be stored, or the state of that tick is another one when the episode is played again, in words.
    fn store(&self, episode: &PlayedEpisode, tick: u32, words: &str, tester: &str) -> Result<FoundInEpisode, String>;
}

/// No detectors: nothing is found, and no report is stored.
#[derive(Clone, Copy, Debug)]
pub struct NoExaminer;

impl Examiner for NoExaminer {
    fn examine(&self, _: &PlayedEpisode, _: &str) -> Result<Vec<FoundInEpisode>, String> {
        Ok(Vec::new())
    }

    fn store(&self, _: &PlayedEpisode, _: u32, _: &str, _: &str) -> Result<FoundInEpisode, String> {
        Err("this session stores no findings".to_owned())
    }
}

/// A server for one client, which has started the program.
pub struct Server<'a> {
    /// What is played: one arena, in which an episode is followed by nothing until the model begins another.
    pub settings: &'a Settings<'a>,
    /// The bounds.
    pub bounds: Bounds,
    /// The folder of recordings, which is there.
    pub folder: &'a Path,
    /// The detectors.
    pub examiner: &'a dyn Examiner,
    /// Asked now and then whether to stop.
    pub stops: &'a dyn Fn() -> bool,
    /// Gets a line for each thing that a person may want to know.
    pub report: &'a dyn Fn(&str),
}

/// The end of a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SessionEnd {
    /// Episodes that were begun.
    pub episodes: usize,
    /// Ticks that were played.
    pub ticks: u64,
    /// The file with the episodes, if there are any.
    pub recording: Option<PathBuf>,
    /// Findings, the model's own included.
    pub findings: usize,
}

impl fmt::Display for SessionEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { episodes, ticks, recording, findings } = self;
        let counted = |count: u64, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
        let (episodes, findings) = (counted(*episodes as u64, "episode"), counted(*findings as u64, "finding"));
        write!(f, "{episodes}, {}, {findings}", counted(*ticks, "tick"))?;
        recording.iter().try_for_each(|recording| write!(f, ", recorded in {}", recording.display()))
    }
}

impl Server<'_> {
    /// Talks with the client until it leaves, or until it is time to stop. Then the running episode is recorded, too.
    ///
    /// # Errors
    ///
    /// The system starts no thread, or a file of the recording cannot be written.
    pub fn run(&self, input: impl Read + Send + 'static, output: &mut dyn Write) -> io::Result<SessionEnd> {
        let inbox = Inbox::of(input)?;
        let settings = Settings { arenas: 1, threads: 1, ..self.settings.clone() };
        let memory = Arc::new(Memory::of_messages(settings.layout()));
        let mut session = Session::new(self, &settings, memory.clone(), output);
        // Worlds are built for the first call that needs one, and anew after each panic.
        let mut pause = session.talk(&inbox, None, None);
        while let Pause::NeedsWorlds(request) = pause {
            let id = request.id.clone();
            let talked = with_worlds(&settings, &memory, |worlds| session.talk(&inbox, Some(worlds), Some(request)));
            pause = match talked {
                Ok(Pause::Broken) => session.talk(&inbox, None, None),
                Ok(pause) => pause,
                Err(why) => session.cannot_play(&inbox, &id, &why),
            };
        }
        session.end().map_err(io::Error::other)
    }
}
