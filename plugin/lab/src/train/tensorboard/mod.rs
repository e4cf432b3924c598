//! Event files for [TensorBoard](https://www.tensorflow.org/tensorboard): the metrics of a run as its curves.
//!
//! An event file is a sequence of framed records (TFRecord), each of them a protobuf [`Event`]. The crates for them
//! bring image codecs, code generators or an asynchronous runtime along, and the part for scalars is small enough to
//! implement here. Every byte is tested against the output of TensorBoard's own writer.

mod event;
mod file;
mod record;
#[cfg(test)]
pub(super) mod testing;

pub use event::{Event, EventKind};
pub use file::EventFolder;
