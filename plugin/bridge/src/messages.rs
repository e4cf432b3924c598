//! The messages of the protocol.
//!
//! A message is its length in bytes, without these four, as a whole number of 32 bits with the lowest byte first; then a
//! byte with its [`Kind`]; then its content.
//!
//! ```
//! use playbot_bridge::messages::{Kind, read, write};
//!
//! let mut bytes = Vec::new();
//! write(&mut bytes, Kind::Call, &[br#"{"call":"mapped"}"#])?;
//! assert_eq!(bytes[..5], [18, 0, 0, 0, 4]);
//! let (kind, content) = read(&mut bytes.as_slice(), 1024)?.expect("a message");
//! assert_eq!((kind, content.len()), (Kind::Call, 17));
//! # Ok::<(), std::io::Error>(())
//! ```

use serde::{Deserialize, Serialize};
use std::io::{self, ErrorKind, Read, Write};

/// Version of the protocol. Client and program must have the same.
pub const PROTOCOL: u32 = 1;

/// Most bytes of a message from a client whose content is JSON.
pub const MOST_JSON: usize = 1 << 24;

/// The kind of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// Both sides: the first message, JSON. The client's is a [`Hello`], the program's describes game and arrays.
    Hello = 1,
    /// Client: begin episodes, a JSON [`Reset`]. The answer is a [`State`](Self::State).
    Reset = 2,
    /// Client: one step with the actions, which are its content unless they lie in shared memory. The answer is a
    /// [`State`](Self::State).
    Step = 3,
    /// Client: anything else, a JSON [`Call`]. The answer is an [`Answer`](Self::Answer) or [`Bytes`](Self::Bytes).
    Call = 4,
    /// Client: the end of the conversation. There is no answer.
    Close = 5,
    /// Program: a byte with the number of the results that are valid now, and the results unless they lie in shared
    /// memory.
    State = 10,
    /// Program: the answer to a call, JSON.
    Answer = 11,
    /// Program: the answer to a call that asks for bytes.
    Bytes = 12,
    /// Program: what was wrong, a JSON [`Refusal`]. Unless it says that the conversation is over, nothing has changed.
    Error = 255,
}

impl Kind {
    fn of(byte: u8) -> Option<Self> {
        let all = [
            Self::Hello,
            Self::Reset,
            Self::Step,
            Self::Call,
            Self::Close,
            Self::State,
            Self::Answer,
            Self::Bytes,
            Self::Error,
        ];
        all.into_iter().find(|kind| *kind as u8 == byte)
    }
}

/// Writes a message whose content are these parts.
///
/// # Errors
///
/// The other side is gone.
pub fn write(stream: &mut impl Write, kind: Kind, parts: &[&[u8]]) -> io::Result<()> {
    let content: usize = parts.iter().map(|part| part.len()).sum();
    let length = u32::try_from(content + 1).map_err(|_| io::Error::from(ErrorKind::FileTooLarge))?;
    // In one piece, so that the other side wakes once.
    let mut message = Vec::with_capacity(content + 5);
    message.extend(length.to_le_bytes());
    message.push(kind as u8);
    parts.iter().for_each(|part| message.extend_from_slice(part));
    stream.write_all(&message)?;
    stream.flush()
}

/// Writes a message whose content is JSON.
///
/// # Errors
///
/// The other side is gone.
pub fn write_json(stream: &mut impl Write, kind: Kind, content: &impl Serialize) -> io::Result<()> {
    write(stream, kind, &[serde_json::to_string(content)?.as_bytes()])
}

/// Reads a message; `None` if the other side has left between two messages.
///
/// # Errors
///
/// The other side has left within a message, or this is none: an unknown kind, or more than `most` bytes.
pub fn read(stream: &mut impl Read, most: usize) -> io::Result<Option<(Kind, Vec<u8>)>> {
    let mut head = [0; 5];
    let mut got = 0;
    while got < head.len() {
        match stream.read(&mut head[got..]) {
            Ok(0) if got == 0 => return Ok(None),
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(bytes) => got += bytes,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    let invalid = |why: String| io::Error::new(ErrorKind::InvalidData, why);
    let length = u32::from_le_bytes([head[0], head[1], head[2], head[3]]) as usize;
    let kind = Kind::of(head[4]).ok_or_else(|| invalid(format!("there is no message of kind {}", head[4])))?;
    if length == 0 || length - 1 > most {
        return Err(invalid(format!("a message of {length} bytes; at most {} are possible", most + 1)));
    }
    let mut content = vec![0; length - 1];
    stream.read_exact(&mut content)?;
    Ok(Some((kind, content)))
}

/// The first message of a client.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Hello {
    /// The version of the protocol that it speaks.
    pub protocol: u32,
    /// Its name and version, for messages.
    #[serde(default)]
    pub client: String,
}

/// Wish for new episodes. Episodes that run are left.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Reset {
    /// Numbers of the arenas, from 0; all of them if left out.
    #[serde(default)]
    pub arenas: Option<Vec<usize>>,
    /// A level for each of these arenas, for one episode; drawn ones if left out.
    #[serde(default)]
    pub levels: Option<Vec<u64>>,
    /// Seed of the streams from which levels are drawn, from now on; if left out, the streams go on.
    #[serde(default)]
    pub seed: Option<u64>,
}

/// Call of anything but a step.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(tag = "call", rename_all = "lowercase", deny_unknown_fields)]
pub enum Call {
    /// The client has shared memory open: its name is taken away. The answer is `{}`.
    Mapped,
    /// The hash of an arena's state, as recordings have it: `{"hash": "0123456789abcdef"}`.
    Hash {
        /// Number of the arena.
        arena: usize,
    },
    /// Keep the episode of an arena as it is now: `{"saved": 3}`.
    Save {
        /// Number of the arena.
        arena: usize,
    },
    /// Go on from a kept episode, whose level the arena has played last. The answer is a state.
    Load {
        /// Number of the arena.
        arena: usize,
        /// Number of the kept episode.
        saved: u64,
    },
    /// Drop a kept episode. The answer is `{}`.
    Forget {
        /// Number of the kept episode.
        saved: u64,
    },
    /// The picture of an arena, as bytes `[height, width, 3]`.
    Render {
        /// Number of the arena.
        arena: usize,
    },
    /// Record all episodes from their next beginnings on, into a folder of `.demo` files that is made: `{"files": [...]}`.
    Record {
        /// Path of the folder.
        folder: String,
    },
}

/// Content of an error.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Refusal {
    /// What was wrong, and what to do.
    pub error: String,
    /// The arena that it is about, if it is about one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arena: Option<usize>,
    /// Whether the conversation is over.
    #[serde(default)]
    pub fatal: bool,
}

impl Refusal {
    /// Makes a refusal after which the conversation goes on.
    pub fn new(error: impl Into<String>) -> Self {
        Self { error: error.into(), arena: None, fatal: false }
    }

    /// Makes a refusal that is about an arena.
    pub fn of_arena(arena: usize, error: impl Into<String>) -> Self {
        Self { arena: Some(arena), ..Self::new(error) }
    }

    /// Makes a refusal that ends the conversation.
    pub fn fatal(error: impl Into<String>) -> Self {
        Self { fatal: true, ..Self::new(error) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_read_as_they_were_written() {
        let mut bytes = Vec::new();
        write(&mut bytes, Kind::Step, &[&[1, 2], &[3]]).expect("room");
        write(&mut bytes, Kind::Close, &[]).expect("room");
        let mut stream = bytes.as_slice();
        assert_eq!(read(&mut stream, 3).expect("whole"), Some((Kind::Step, vec![1, 2, 3])));
        assert_eq!(read(&mut stream, 3).expect("whole"), Some((Kind::Close, vec![])));
        assert_eq!(read(&mut stream, 3).expect("the end"), None);
    }

    #[test]
    fn what_is_no_message_is_refused() {
        let refused = |bytes: &[u8]| read(&mut &*bytes, 16).expect_err("no message").to_string();
        assert_eq!(refused(&[1, 0, 0, 0, 99]), "there is no message of kind 99");
        assert!(refused(&[255, 255, 255, 255, 3]).contains("at most 17"));
        assert!(refused(&[0, 0, 0, 0, 3]).contains("of 0 bytes"));
        // It leaves within a message.
        refused(&[9, 0]);
        refused(&[9, 0, 0, 0, 3, 1]);
    }

    #[test]
    fn calls_are_json_with_their_name() {
        let call: Call = serde_json::from_str(r#"{"call":"load","arena":2,"saved":7}"#).expect("a call");
        assert!(matches!(call, Call::Load { arena: 2, saved: 7 }));
        let why = |text: &str| serde_json::from_str::<Call>(text).expect_err("no call").to_string();
        assert!(why(r#"{"call":"fly"}"#).contains("unknown variant `fly`"));
        assert!(why(r#"{"call":"hash"}"#).contains("missing field `arena`"));
    }
}
