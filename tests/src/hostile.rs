//! Files damaged by an adversary, a bad disk or a slip of the keyboard, of every kind that the program reads back.
//!
//! - [`all_kinds`] makes a whole file of each kind, with its reader.
//! - [`Form`] changes such files and keeps their structure: frames, tensors, lines and entries that are removed,
//!   doubled or moved, lengths and numbers at their extremes, and in half of the cases checksums that fit again.
//! - [`read_mutants`] reads them: none may panic, take long or ask for much memory.

mod bytes;
mod campaign;
mod corpus;
mod dice;
mod form;
mod heard;
mod kind;
mod lines;
mod pieces;
mod recordings;
mod seals;
mod tensors;
mod texts;

pub use campaign::{HostileFault, MOST_BYTES, Measure, PATIENCE, Tally, read_mutants};
pub use corpus::all_kinds;
pub use dice::Dice;
pub use form::Form;
pub use kind::{FileKind, Reading};
