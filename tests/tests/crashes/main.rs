//! Power cuts at every place where something is written: what lies on the disk then is opened and gone on with.

mod buffers;
mod forced;
mod levels;
mod policies;
mod recordings;
mod replaced;
mod runs;
mod skills;
mod studies;
mod tree;
