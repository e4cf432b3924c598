//! Tests of power cuts at every write: the files on the disk then are opened, and the work is resumed.

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
