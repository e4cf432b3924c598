//! Event files for [TensorBoard](https://www.tensorflow.org/tensorboard): the metrics of a run as its curves.
//!
//! An event file is a sequence of framed records (TFRecord), each of them a protobuf [`Event`]. The crates that write
//! them bring image codecs, code generators or an asynchronous runtime along; the part that scalars need is small enough
//! to be written out here. Every byte of it is tested against what TensorBoard's own writer gives.

mod event;
mod file;
mod record;
#[cfg(test)]
pub(super) mod testing;

pub use event::{Event, EventKind};
pub use file::EventFolder;
