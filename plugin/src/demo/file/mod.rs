//! Recordings: files of recorded episodes.
//!
//! A file begins as text, so `head` shows its contents, and goes on with one frame per episode:
//!
//! ```text
//! playbot-demo header=00000214 crc32=5d3a90c1     magic line: length and checksum of the header
//! (
//!     format: 1,                                  header, RON: see DemoHeader
//!     game: "coinrun",
//!     …
//! )
//! // playbot-demo header=00000102 crc32=0c1d2e3f  the same once more, as comments
//! // …
//! FE 45 50 FF | length | payload | CRC-32         a frame: see DemoEpisode
//! FE 45 50 FF | length | payload | CRC-32
//! ```
//!
//! - Files only grow. [`DemoWriter::push`] writes one frame with a single write and waits for the disk: after a
//!   crash, the episodes before it are still there.
//! - Everything is checked. [`DemoReader`] returns an episode only when its checksum holds, its lists agree in
//!   length, its actions are in range and its numbers are finite.
//! - The header is stored twice: if one copy is damaged, the other one identifies the recording.
//! - A damaged file is an error with a position. [`repair`](repair()) recovers every intact episode, also behind the
//!   damage.
//! - A tick of a game with at most 256 actions takes about 5 bytes: the action and the state hash.
//!   Rewards and deciders are stored as runs.

mod bytes;
mod episode;
mod episode_fault;
mod error;
mod find;
mod frame;
mod header;
mod merge;
mod payload;
mod preamble;
mod reader;
mod repair;
mod second_header;
mod store;
mod summary;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod writer;

pub use episode::{Decider, DemoEnd, DemoEpisode, EpisodeActions};
pub use episode_fault::EpisodeFault;
pub use error::{DemoFault, DemoFileError};
#[doc(hidden)]
pub use find::find_demos;
pub use header::{DemoActions, DemoHeader};
pub use merge::{MergeReport, merge_demos};
pub use reader::DemoReader;
pub use writer::DemoWriter;

// For playbot_lab, playbot_cli and tests; games need none of it.
#[doc(hidden)]
pub use header::DEMO_FORMAT;
#[doc(hidden)]
pub use preamble::DEMO_MAGIC;
#[doc(hidden)]
pub use repair::{DroppedRegion, RepairReport, repair};
#[doc(hidden)]
pub use summary::DemoSummary;
